"""Which variants of each pool become samples and in which split (by structure), then in which shard."""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.errors import ConfigError
from pipeline.shards import array_bytes, json_bytes
from pipeline.stage import Outcome, Task
from stages.exemplars.settings import ExemplarsConfig
from stages.shape.collection.assignment import SPLITS, assign_shards, assign_splits
from stages.shape.kit import Kit
from stages.shape.kit_input import input_kit
from stages.variations.novelty.kit_overlap import kit_overlap
from stages.variations.novelty.low_diversity import NEAR_COPY_SHARE, low_diversity
from stages.variations.report.measures import EDIT_SAMPLE_SIZE, edit_measures, have_new_plans, pool_measures
from stages.variations.search.pool import PoolIndex
from stages.variations.search.rounds import selection_name
from stages.variations.selection.ancestry import read_ancestry
from stages.variations.selection.farthest_first import select_diverse
from stages.variations.selection.partition import (
    SelectedSamples,
    choose_by_family,
    nearness_of,
    packed_shapes,
    split_candidates,
)
from stages.variations.settings import VariationsConfig


def run_selection(task: Task) -> Outcome:
    """Choose the variants of one kit from its pool, and give each its split.

    Writes rows int64 (k, 4) in the order of the samples: row of `searches.txt`, index there, number in the kit, split.
    Writes `parents.jsonl`: for each row the names of its nearest ancestors in its split and among the exemplars.
    """
    name: str = task.shard.params["kit"]
    config, kit = task.config.section(VariationsConfig), input_kit(task, name)
    pool = PoolIndex.of(task, name, len(kit.types))
    ancestry = read_ancestry(task, pool)
    rng = task.rng("selection")
    if config.splits.by == "family":
        considered = split_candidates(kit, pool, config, rng)
        shapes = packed_shapes(task, kit, pool, considered)
        selected = choose_by_family(kit, pool, ancestry, considered, shapes, config, rng)
    else:
        selected = _by_graph(task, kit, pool, rng)
    variants = selected.variants.tolist()
    keys = {variant: sample_key(name, number) for number, variant in enumerate(variants)}
    named = ancestry.named(keys, dict(zip(variants, selected.split_of.tolist(), strict=True)))
    numbers = np.arange(len(variants))
    rows = np.column_stack([pool.rows[selected.variants], numbers, selected.split_of]).astype(np.int64)
    with task.output(f"{task.shard.name}.rows.npy") as stream:
        stream.write(array_bytes(rows))
    with task.output(f"{task.shard.name}.parents.jsonl") as stream:
        stream.writelines(json_bytes(named[variant]) for variant in variants)
    with task.output(f"{task.shard.name}.searches.txt") as stream:
        stream.write("".join(f"{search}\n" for search in pool.searches).encode())
    return Outcome(0, _measures(task, kit, pool, selected))


def run_assignment(task: Task) -> Outcome:
    """Give the chosen variants of all kits their shards.

    Writes rows int64 (k, 6) in the order of the samples: kit, row of `searches.txt`, index there, number in the kit,
    split, shard; `parents.jsonl` with a line for each row, as of the selections; and `searches.txt`.
    """
    config = task.config.section(VariationsConfig)
    measured = task.shard.params["kits"]
    kits = {kit.name: measured[kit.name] for kit in task.config.section(ExemplarsConfig).kits}
    if not any(measures["variants"] for measures in kits.values()):
        advice = [f"{name}: {measures['advice']}" for name, measures in kits.items()]
        raise ConfigError("\n".join(["the search found no variant of any kit", *advice]))
    chosen = [np.empty((0, 5), dtype=np.int64)]
    parents: list[bytes] = []
    searches: list[str] = []
    for number, name in enumerate(kits):
        rows = np.load(task.input("variations", f"{selection_name(name)}.rows.npy"), allow_pickle=False)
        rows[:, 0] += len(searches)
        chosen.append(np.insert(rows, 0, number, axis=1))
        parents += task.input("variations", f"{selection_name(name)}.parents.jsonl").read_bytes().splitlines()
        text = task.input("variations", f"{selection_name(name)}.searches.txt").read_text(encoding="utf-8")
        searches += text.splitlines()
    joined = np.concatenate(chosen)
    shards = assign_shards(joined[:, 4], config.splits, task.rng("order"))
    order = [
        (row, shard) for rows_of in shards.values() for shard, members in enumerate(rows_of) for row in members.tolist()
    ]
    with task.output(f"{task.shard.name}.rows.npy") as stream:
        rows_of_all = [(*joined[row].tolist(), shard) for row, shard in order]
        stream.write(array_bytes(np.array(rows_of_all, dtype=np.int64)))
    with task.output(f"{task.shard.name}.parents.jsonl") as stream:
        stream.writelines(parents[row] + b"\n" for row, _ in order)
    with task.output(f"{task.shard.name}.searches.txt") as stream:
        stream.write("".join(f"{name}\n" for name in searches).encode())
    graphs = sum(measures["graphs"] for measures in kits.values())
    counts = {split: len(rows_of) for split, rows_of in shards.items()}
    return Outcome(0, {"shards": counts, "variants": len(joined), "graphs": graphs, "kits": kits})


def _by_graph(task: Task, kit: Kit, pool: PoolIndex, rng: np.random.Generator) -> SelectedSamples:
    """Choose the most diverse variants; those with equal canonical graphs go to one split."""
    config = task.config.section(VariationsConfig)
    chosen = select_diverse(kit, pool.counts, pool.features, config.samples_per_kit, config, rng)
    groups: dict[bytes, list[int]] = {}
    for row, variant in enumerate(chosen.tolist()):
        groups.setdefault(bytes(pool.digests[variant, 0]), []).append(row)
    split_of = assign_splits(list(groups.values()), config.splits, task.rng("splits"))
    shapes = packed_shapes(task, kit, pool, chosen)
    return SelectedSamples(chosen, split_of, 0, nearness_of(shapes, np.arange(len(chosen)), split_of))


def _measures(task: Task, kit: Kit, pool: PoolIndex, chosen: SelectedSamples) -> dict[str, Any]:
    """Return the measures of a kit's samples, as JSON."""
    config, variants = task.config.section(VariationsConfig), chosen.variants
    taken = pool.counts[variants], pool.features[variants], pool.digests[variants]
    sample = task.rng("edits").permutation(variants)[:EDIT_SAMPLE_SIZE].tolist()
    wanted = config.splits.sizes(config.samples_per_kit)
    splits = {
        split: {
            "wanted": wanted[split],
            "samples": int((chosen.split_of == number).sum()),
            **chosen.nearness.get(split, {}),
        }
        for number, split in enumerate(SPLITS)
    }
    copied = [found.described(at)["copied"] for found, at in pool.variants(task, variants.tolist())]
    pieces = np.array([described["pieces"] for described in copied])
    worth = {"variants": len(variants), **pool_measures(*taken, config.search.novelty)}
    return {
        "pool": len(pool),
        **worth,
        "pieces": float(np.median(pieces)) if len(pieces) else 0.0,
        "new_plans": _share(have_new_plans(taken[1], pieces)),
        "whole": _share(np.array([described["exemplar_share"] for described in copied]) > NEAR_COPY_SHARE),
        "low_diversity": low_diversity(kit, worth),
        "edits": edit_measures(kit, [found.assembly(at)[0] for found, at in pool.variants(task, sample)]),
        **task.shard.params["searched"],
        "strictness": kit.grammar.strictness,
        "kit_overlap": kit_overlap(kit),
        "splits": splits,
        "split_by": config.splits.by,
        "min_shared_surface": config.splits.min_shared_surface,
        "discarded": chosen.discarded,
    }


def _share(holds: np.ndarray) -> float:
    return round(float(holds.mean()), 4) if len(holds) else 0.0


def sample_key(kit: str, number: int) -> str:
    """Return the key of a sample, by its number among those of its kit."""
    return f"{kit}-{number:06d}"
