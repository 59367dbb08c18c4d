"""The assignment: which variants of each pool become samples, in which split and shard (splits by structure)."""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.errors import ConfigError
from pipeline.shards import array_bytes, json_bytes
from pipeline.stage import Outcome, Task
from stages.shape.collection.assignment import SPLITS, assign_shards, assign_splits
from stages.shape.kit_input import input_kit
from stages.variations.novelty.kit_overlap import kit_overlap
from stages.variations.novelty.low_diversity import NEAR_COPY_SHARE, low_diversity
from stages.variations.report.measures import EDIT_SAMPLE_SIZE, edit_measures, have_new_plans, pool_measures
from stages.variations.search.pool import PoolIndex
from stages.variations.selection.ancestry import Ancestry, read_ancestry
from stages.variations.selection.farthest_first import select_diverse
from stages.variations.selection.partition import (
    SelectedSamples,
    choose_by_family,
    nearness_of,
    packed_shapes,
    split_candidates,
)
from stages.variations.settings import VariationsConfig


def run_assignment(task: Task) -> Outcome:
    """Choose the variants of each kit from its pool, and give each its split and shard.

    Writes rows int64 (k, 6) in the order of the samples: kit, row of `searches.txt`, index there, number in the kit,
    split,
    shard. Writes `parents.jsonl`: for each row the names of its nearest ancestors in its split and among the exemplars.
    """
    config = task.config.section(VariationsConfig)
    kits: list[str] = task.shard.params["kits"]
    pools = [PoolIndex.of(task, name, len(input_kit(task, name).types)) for name in kits]
    ancestries = [read_ancestry(task, pool) for pool in pools]
    if config.splits.by == "family":
        chosen = [_by_family(task, *kit) for kit in zip(kits, pools, ancestries, strict=True)]
    else:
        chosen = _by_graph(task, kits, pools)
    total = sum(len(selected.variants) for selected in chosen)
    if not total:
        advice = [f"{name}: {task.shard.params['searched'][name]['advice']}" for name in kits]
        raise ConfigError("\n".join(["the search found no variant of any kit", *advice]))
    rows: list[tuple[int, int, int, int]] = []
    parents: list[list[str]] = []
    searches: dict[str, int] = {}
    measures: dict[str, Any] = {}
    for kit, (name, pool, ancestry, selected) in enumerate(zip(kits, pools, ancestries, chosen, strict=True)):
        measures[name] = _measures(task, name, pool, selected)
        task.progress(kit + 1, len(kits))
        variants = selected.variants.tolist()
        keys = {variant: sample_key(name, number) for number, variant in enumerate(variants)}
        named = ancestry.named(keys, dict(zip(variants, selected.split_of.tolist(), strict=True)))
        for number, variant in enumerate(variants):
            search, index = pool.rows[variant].tolist()
            rows.append((kit, searches.setdefault(pool.searches[search], len(searches)), index, number))
            parents.append(named[variant])
    split_of = np.concatenate([selected.split_of for selected in chosen])
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
    with task.output(f"{task.shard.name}.searches.txt") as stream:
        stream.write("".join(f"{name}\n" for name in searches).encode())
    graphs = sum(kit_measures["graphs"] for kit_measures in measures.values())
    counts = {split: len(rows_of) for split, rows_of in shards.items()}
    return Outcome(0, {"shards": counts, "variants": total, "graphs": graphs, "kits": measures})


def _by_family(task: Task, name: str, pool: PoolIndex, ancestry: Ancestry) -> SelectedSamples:
    kit, config, rng = input_kit(task, name), task.config.section(VariationsConfig), task.rng("selection", name)
    considered = split_candidates(kit, pool, config, rng)
    shapes = packed_shapes(task, kit, pool, considered)
    return choose_by_family(kit, pool, ancestry, considered, shapes, config, rng)


def _by_graph(task: Task, kits: list[str], pools: list[PoolIndex]) -> list[SelectedSamples]:
    """Choose the most diverse variants of each kit; those of one kit with equal canonical graphs go to one split."""
    config = task.config.section(VariationsConfig)
    taken: list[np.ndarray] = []
    groups: dict[tuple[int, bytes], list[int]] = {}
    for number, (name, pool) in enumerate(zip(kits, pools, strict=True)):
        rng = task.rng("selection", name)
        chosen = select_diverse(
            input_kit(task, name), pool.counts, pool.features, config.samples_per_kit, config.selection, rng
        )
        first = sum(len(variants) for variants in taken)
        for row, variant in enumerate(chosen.tolist(), start=first):
            groups.setdefault((number, bytes(pool.digests[variant, 0])), []).append(row)
        taken.append(chosen)
    split_of = assign_splits(list(groups.values()), config.splits, task.rng("splits"))
    ends = np.cumsum([len(variants) for variants in taken])[:-1]
    selected = []
    for name, pool, own, splits in zip(kits, pools, taken, np.split(split_of, ends), strict=True):
        shapes = packed_shapes(task, input_kit(task, name), pool, own)
        selected.append(SelectedSamples(own, splits, 0, nearness_of(shapes, np.arange(len(own)), splits)))
    return selected


def _measures(task: Task, name: str, pool: PoolIndex, chosen: SelectedSamples) -> dict[str, Any]:
    """Return the measures of a kit's samples, as JSON."""
    config, kit, variants = task.config.section(VariationsConfig), input_kit(task, name), chosen.variants
    taken = pool.counts[variants], pool.features[variants], pool.digests[variants]
    sample = task.rng("edits", name).permutation(variants)[:EDIT_SAMPLE_SIZE].tolist()
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
        **task.shard.params["searched"][name],
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
