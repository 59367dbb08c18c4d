"""The collection: which variants become samples, in which split and shard (splits by structure, not by row)."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np

from pipeline.errors import ShardFailed
from pipeline.shards import ShardWriter, array_bytes
from pipeline.stage import Outcome, Plan, Shard, Task
from stages.exemplars.settings import ExemplarsConfig
from stages.shape.graphs.canonical import graph_digest
from stages.shape.kit_input import input_kit
from stages.shape.sample import Sample, write_sample
from stages.shape.splits import SPLITS, shards_of_split, share_out
from stages.variations.backdrop import Backdrop, backdrop_of
from stages.variations.measures import SAMPLE, edit_measures, pool_measures
from stages.variations.meeting import meeting
from stages.variations.pool import FoundVariants, PoolIndex
from stages.variations.rounds import last_pool
from stages.variations.selection import select
from stages.variations.settings import VariationsConfig

__all__ = ["assignment_shard", "collection_shards_of", "run_assignment", "run_collection"]


def assignment_shard(plan: Plan, search: list[Shard]) -> Shard:
    """The shard that shares out the variants, once the search of every kit has ended."""
    kits = [kit.name for kit in plan.config.section(ExemplarsConfig).kits]
    inputs = (*(f"exemplars/{kit}" for kit in kits), *(f"variations/{each.name}" for each in search))
    ends = {kit: last_pool(plan, kit) for kit in kits}
    searched = {kit: {"curve": end["curve"], "crossings": end["crossings"]} for kit, end in ends.items()}
    params = {"job": "assignment", "kits": kits, "searched": searched}
    return Shard(f"{plan.config.name}-assignment", params, inputs)


def collection_shards_of(plan: Plan, assignment: Shard) -> list[Shard]:
    """The shards of the collection, `<dataset>-<split>-<index>`, empty until the assignment is made."""
    summary = plan.summary("variations", assignment.name)
    if summary is None:
        return []
    lanes = tuple(each for each in assignment.inputs if not each.endswith("-pool"))
    return [
        Shard(
            f"{plan.config.name}-{split}-{number:06d}",
            {"job": "collection", "split": split, "number": number},
            (*lanes, f"variations/{assignment.name}"),
        )
        for split in SPLITS
        for number in range(summary["shards"][split])
    ]


def run_assignment(task: Task) -> Outcome:
    """Choose the variants of each kit from its pool, and give each its split, shard and place.

    Variants of one kit with equal canonical graphs stand in one split. Writes rows int64 (k, 6): kit, row of
    `lanes.txt`, index there, place in the kit, split, shard, in the order of the samples.
    """
    config = task.config.section(VariationsConfig)
    rows: list[tuple[int, int, int, int]] = []
    groups: dict[tuple[int, bytes], list[int]] = {}
    lanes: dict[str, int] = {}
    measures: dict[str, Any] = {}
    for number, name in enumerate(task.shard.params["kits"]):
        kit = input_kit(task, name)
        pool = PoolIndex.of(task, name, len(kit.types))
        rng = task.rng("selection", name)
        chosen = select(kit, pool.counts, pool.features, config.per_kit, config.selection, rng)
        taken = pool.counts[chosen], pool.features[chosen], pool.digests[chosen]
        sample = rng.permutation(chosen)[:SAMPLE].tolist()
        measures[name] = {
            "pool": len(pool),
            "variants": len(chosen),
            **pool_measures(*taken, config.search.novelty),
            "edits": edit_measures(kit, [found.assembly(at)[0] for found, at in pool.variants(task, sample)]),
            **task.shard.params["searched"][name],
            "strictness": kit.grammar.strictness,
            "meeting": meeting(kit),
        }
        for place, variant in enumerate(chosen.tolist()):
            lane, index = pool.rows[variant].tolist()
            groups.setdefault((number, bytes(pool.digests[variant, 0])), []).append(len(rows))
            rows.append((number, lanes.setdefault(pool.lanes[lane], len(lanes)), index, place))
    if not rows:
        raise ShardFailed("the search found no variant of any kit; see `python -m pipeline status` for the reasons")
    split_of = share_out(list(groups.values()), config.splits.val, config.splits.test, task.rng("splits"))
    order = task.rng("order").permutation(len(rows))
    placed: list[np.ndarray] = []
    shards: dict[str, int] = {}
    for split, name in enumerate(SPLITS):
        members = order[split_of[order] == split]
        shard = shards_of_split(len(members), config.splits.shards, config.splits.samples_per_shard)
        shards[name] = int(shard[-1]) + 1 if len(members) else 0
        placed.append(
            np.concatenate([np.array(rows)[members], np.full((len(members), 1), split), shard[:, None]], axis=1)
        )
    with task.output(f"{task.shard.name}.rows.npy") as stream:
        stream.write(array_bytes(np.concatenate(placed).astype(np.int64)))
    with task.output(f"{task.shard.name}.lanes.txt") as stream:
        stream.write("".join(f"{name}\n" for name in lanes).encode())
    return Outcome(0, {"shards": shards, "variants": len(rows), "graphs": len(groups), "kits": measures})


def run_collection(task: Task) -> Outcome:
    """Write the samples of one shard."""
    assignment = f"{task.config.name}-assignment"
    rows = np.load(task.input("variations", f"{assignment}.rows.npy"), allow_pickle=False)
    lanes = task.input("variations", f"{assignment}.lanes.txt").read_text().splitlines()
    kits = [kit.name for kit in task.config.section(ExemplarsConfig).kits]
    split: str = task.shard.params["split"]
    mine = rows[(rows[:, 4] == SPLITS.index(split)) & (rows[:, 5] == task.shard.params["number"])]
    found: dict[int, FoundVariants] = {}
    counts: Counter[str] = Counter()
    with task.output(f"{task.shard.name}.tar") as stream, ShardWriter(stream) as writer:
        for kit, lane, index, place in mine[:, :4].tolist():
            if lane not in found:
                found[lane] = FoundVariants.of(task, lanes[lane])
            write_sample(writer, _sample(backdrop_of(task, kits[kit]), place, split, found[lane], index))
            counts[kits[kit]] += 1
    summary: dict[str, Any] = {"split": split, "samples": len(mine), "kits": dict(sorted(counts.items()))}
    return Outcome(len(mine), summary)


def _sample(backdrop: Backdrop, place: int, split: str, found: FoundVariants, index: int) -> Sample:
    """One variant with its backdrop. Variants whose graphs are equal with it are equal without it, so it never
    takes a graph into another split."""
    bare, _ = found.assembly(index)
    assembly = backdrop.fit(bare)
    kit, added = backdrop.kit.name, len(assembly) - len(bare)
    return Sample(
        key=f"{kit}-{place:06d}",
        split=split,
        producer="variations",
        kit=kit,
        graph=graph_digest(assembly.types, assembly.edges) if added else found.digest(index),
        assembly=assembly,
        lineage={
            "method": "exchange",
            "name": f"{found.name}-{index}",
            **found.described(index),
            "made_of": found.described(index)["parents"],
            "backdrop": added,
        },
    )
