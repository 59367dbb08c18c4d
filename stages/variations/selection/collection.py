"""The collection: which variants become samples, in which split and shard (splits by structure, not by row)."""

from __future__ import annotations

import json
from collections import Counter
from typing import Any

import numpy as np

from pipeline.errors import ConfigError
from pipeline.shards import ShardWriter, array_bytes, json_bytes
from pipeline.stage import Outcome, Plan, Shard, Task
from stages.exemplars.settings import ExemplarsConfig
from stages.shape.collection.assignment import SPLITS, assign_shards, assign_splits, planned_collection
from stages.shape.graphs.canonical import graph_digest
from stages.shape.kit_input import input_kit
from stages.shape.sample import Sample, write_sample
from stages.variations.novelty.kit_overlap import kit_overlap
from stages.variations.novelty.low_diversity import low_diversity
from stages.variations.report.measures import SAMPLE, edit_measures, pool_measures
from stages.variations.requirements.hub_restoration import HubRestorer, hub_restorer
from stages.variations.search.pool import FoundVariants, PoolIndex
from stages.variations.search.rounds import last_pool
from stages.variations.selection.ancestry import Ancestry, read_ancestry
from stages.variations.selection.farthest_first import select_diverse
from stages.variations.selection.orientation import OrientationFix
from stages.variations.selection.partition import (
    SelectedSamples,
    candidates,
    choose_by_family,
    nearness_of,
    packed_shapes,
)
from stages.variations.settings import VariationsConfig


def assignment_shard(plan: Plan, search: list[Shard]) -> Shard:
    """The shard that shares out the variants, once the search of every kit has ended."""
    kits = [kit.name for kit in plan.config.section(ExemplarsConfig).kits]
    inputs = (*(f"exemplars/{kit}" for kit in kits), *(f"variations/{each.name}" for each in search))
    ends = {kit: last_pool(plan, kit) for kit in kits}
    said = ("curve", "crossings", "advice")
    searched = {kit: {key: end[key] for key in said} for kit, end in ends.items()}
    params = {"job": "assignment", "kits": kits, "searched": searched}
    return Shard(f"{plan.config.name}-assignment", params, inputs)


def collection_shards_of(plan: Plan, assignment: Shard) -> list[Shard]:
    """The shards of the collection, `<dataset>-<split>-<index>`, empty until the assignment is made."""
    summary = plan.summary("variations", assignment.name)
    if summary is None:
        return []
    lanes = tuple(each for each in assignment.inputs if not each.endswith("-pool"))
    return planned_collection(plan, summary["shards"], (*lanes, f"variations/{assignment.name}"))


def run_assignment(task: Task) -> Outcome:
    """Choose the variants of each kit from its pool, and give each its split, shard and place.

    Writes rows int64 (k, 6): kit, row of `lanes.txt`, index there, place in the kit, split, shard, in the order of the
    samples; and `parents.jsonl`, for each row the names of its nearest ancestors in its split and among the exemplars.
    """
    config = task.config.section(VariationsConfig)
    kits: list[str] = task.shard.params["kits"]
    pools = [PoolIndex.of(task, name, len(input_kit(task, name).types)) for name in kits]
    ancestries = [read_ancestry(task, pool) for pool in pools]
    if config.splits.by == "family":
        chosen = [_by_family(task, *each) for each in zip(kits, pools, ancestries, strict=True)]
    else:
        chosen = _by_graph(task, kits, pools)
    total = sum(len(each.variants) for each in chosen)
    if not total:
        found = [f"{name}: {task.shard.params['searched'][name]['advice']}" for name in kits]
        raise ConfigError("\n".join(["the search found no variant of any kit", *found]))
    rows: list[tuple[int, int, int, int]] = []
    parents: list[list[str]] = []
    lanes: dict[str, int] = {}
    measures: dict[str, Any] = {}
    for number, (name, pool, ancestry, taken) in enumerate(zip(kits, pools, ancestries, chosen, strict=True)):
        measures[name] = _measures(task, name, pool, taken)
        variants = taken.variants.tolist()
        keys = {variant: _key(name, place) for place, variant in enumerate(variants)}
        named = ancestry.named(keys, dict(zip(variants, taken.split_of.tolist(), strict=True)))
        for place, variant in enumerate(variants):
            lane, index = pool.rows[variant].tolist()
            rows.append((number, lanes.setdefault(pool.lanes[lane], len(lanes)), index, place))
            parents.append(named[variant])
    split_of = np.concatenate([each.split_of for each in chosen])
    shards = assign_shards(split_of, config.splits, task.rng("order"))
    joined = np.array(
        [
            (*rows[row], SPLITS.index(split), shard, row)
            for split, rows_of in shards.items()
            for shard, members in enumerate(rows_of)
            for row in members.tolist()
        ],
        dtype=np.int64,
    )
    with task.output(f"{task.shard.name}.rows.npy") as stream:
        stream.write(array_bytes(joined[:, :6]))
    with task.output(f"{task.shard.name}.parents.jsonl") as stream:
        for row in joined[:, 6].tolist():
            stream.write(json_bytes(parents[row]))
    with task.output(f"{task.shard.name}.lanes.txt") as stream:
        stream.write("".join(f"{name}\n" for name in lanes).encode())
    graphs = sum(each["graphs"] for each in measures.values())
    counts = {split: len(rows_of) for split, rows_of in shards.items()}
    return Outcome(0, {"shards": counts, "variants": total, "graphs": graphs, "kits": measures})


def _by_family(task: Task, name: str, pool: PoolIndex, ancestry: Ancestry) -> SelectedSamples:
    kit, config, rng = input_kit(task, name), task.config.section(VariationsConfig), task.rng("selection", name)
    held = candidates(kit, pool, config, rng)
    return choose_by_family(kit, pool, ancestry, held, packed_shapes(task, kit, pool, held), config, rng)


def _by_graph(task: Task, kits: list[str], pools: list[PoolIndex]) -> list[SelectedSamples]:
    """The variants of each kit that differ most; those of one kit with equal canonical graphs stand in one split."""
    config = task.config.section(VariationsConfig)
    taken: list[np.ndarray] = []
    groups: dict[tuple[int, bytes], list[int]] = {}
    for number, (name, pool) in enumerate(zip(kits, pools, strict=True)):
        rng = task.rng("selection", name)
        chosen = select_diverse(
            input_kit(task, name), pool.counts, pool.features, config.samples_per_kit, config.selection, rng
        )
        first = sum(len(each) for each in taken)
        for row, variant in enumerate(chosen.tolist(), start=first):
            groups.setdefault((number, bytes(pool.digests[variant, 0])), []).append(row)
        taken.append(chosen)
    split_of = assign_splits(list(groups.values()), config.splits, task.rng("splits"))
    ends = np.cumsum([len(each) for each in taken])[:-1]
    found = []
    for name, pool, own, splits in zip(kits, pools, taken, np.split(split_of, ends), strict=True):
        shapes = packed_shapes(task, input_kit(task, name), pool, own)
        found.append(SelectedSamples(own, splits, 0, nearness_of(shapes, np.arange(len(own)), splits)))
    return found


def _measures(task: Task, name: str, pool: PoolIndex, chosen: SelectedSamples) -> dict[str, Any]:
    """What there is to say of the samples of a kit, as JSON."""
    config, kit, variants = task.config.section(VariationsConfig), input_kit(task, name), chosen.variants
    taken = pool.counts[variants], pool.features[variants], pool.digests[variants]
    sample = task.rng("edits", name).permutation(variants)[:SAMPLE].tolist()
    wanted = config.splits.sizes(config.samples_per_kit)
    splits = {
        split: {
            "wanted": wanted[split],
            "samples": int((chosen.split_of == number).sum()),
            **chosen.nearness.get(split, {}),
        }
        for number, split in enumerate(SPLITS)
    }
    pieces = [found.described(at)["copied"]["pieces"] for found, at in pool.variants(task, variants.tolist())]
    worth = {"variants": len(variants), **pool_measures(*taken, config.search.novelty)}
    return {
        "pool": len(pool),
        **worth,
        "pieces": float(np.median(pieces)) if pieces else 0.0,
        "dull": low_diversity(kit, worth),
        "edits": edit_measures(kit, [found.assembly(at)[0] for found, at in pool.variants(task, sample)]),
        **task.shard.params["searched"][name],
        "strictness": kit.grammar.strictness,
        "kit_overlap": kit_overlap(kit),
        "splits": splits,
        "split_by": config.splits.by,
        "split_near": config.splits.min_shared_surface,
        "let_go": chosen.discarded,
    }


def _key(kit: str, place: int) -> str:
    """The key of a sample, by its place among those of its kit."""
    return f"{kit}-{place:06d}"


def run_collection(task: Task) -> Outcome:
    """Write the samples of one shard."""
    assignment = f"{task.config.name}-assignment"
    rows = np.load(task.input("variations", f"{assignment}.rows.npy"), allow_pickle=False)
    parents = task.input("variations", f"{assignment}.parents.jsonl").read_bytes().splitlines()
    lanes = task.input("variations", f"{assignment}.lanes.txt").read_text().splitlines()
    kits = [kit.name for kit in task.config.section(ExemplarsConfig).kits]
    split: str = task.shard.params["split"]
    mine = np.flatnonzero((rows[:, 4] == SPLITS.index(split)) & (rows[:, 5] == task.shard.params["number"]))
    found: dict[int, FoundVariants] = {}
    facing: dict[str, OrientationFix] = {}
    counts: Counter[str] = Counter()
    with task.output(f"{task.shard.name}.tar") as stream, ShardWriter(stream) as writer:
        for row in mine.tolist():
            kit, lane, index, place = rows[row, :4].tolist()
            if lane not in found:
                found[lane] = FoundVariants.of(task, lanes[lane])
            named = json.loads(parents[row])
            behind = hub_restorer(task, kits[kit])
            if kits[kit] not in facing:
                facing[kits[kit]] = OrientationFix(behind.kit)
            write_sample(writer, _sample(behind, facing[kits[kit]], place, split, found[lane], index, named))
            counts[kits[kit]] += 1
    summary: dict[str, Any] = {"split": split, "samples": len(mine), "kits": dict(sorted(counts.items()))}
    return Outcome(len(mine), summary)


def _sample(
    backdrop: HubRestorer,
    facing: OrientationFix,
    place: int,
    split: str,
    found: FoundVariants,
    index: int,
    parents: list[str],
) -> Sample:
    """One variant with its backdrop, facing as the exemplars do.

    Variants whose graphs are equal with it are equal without it, so it never takes a graph into another split. Its
    lineage names as `parents` samples of its own split and exemplars, and as `made_of` what it was put together from:
    exemplars, or variants by the `name` that each variant of the search has.
    """
    bare, _ = found.assembly(index)
    assembly = backdrop.fit(bare)
    turn = facing.turn(assembly)
    kit, added = backdrop.kit.name, len(assembly) - len(bare)
    described = found.described(index)
    return Sample(
        key=_key(kit, place),
        split=split,
        producer="variations",
        kit=kit,
        graph=graph_digest(backdrop.kit.label_of[assembly.types], assembly.edges) if added else found.digest(index),
        assembly=facing.turned_back(assembly, turn),
        lineage={
            "method": described["method"],
            "name": f"{found.name}-{index}",
            **described,
            "parents": parents,
            "made_of": described["parents"],
            "restored_hubs": added,
            "turned_degrees": round(-turn % 360, 6),
        },
    )
