"""A search shard: one search worker's part of a round, and what a config requires of its variants."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.config import Config
from pipeline.stage import Outcome, Task
from stages.exemplars.settings import ExemplarsConfig
from stages.shape.arrays import FloatArray
from stages.shape.kit import Kit
from stages.shape.kit_input import input_kit, input_oracle
from stages.shape.physics.judge import unmet_requirement
from stages.shape.shape import kit_shape
from stages.variations.constraint import build_repair, build_test
from stages.variations.novelty.archive import cell_of_features
from stages.variations.requirements.hub_restoration import HUBS_NOT_RESTORED, auto_min_hubs, hub_restorer
from stages.variations.requirements.identity import common_labels, share_bounds
from stages.variations.requirements.required_labels import LABELS_MISSING, labels_test
from stages.variations.search.pool import PoolIndex, write_variants
from stages.variations.search.row_variants import RowVariants
from stages.variations.search.search import Search
from stages.variations.search.variant import OUT_OF_PROPORTION, Variant
from stages.variations.settings import VariationsConfig

TOO_MUCH_COPIED = "largest verbatim piece too large"
"""Reject reason of a variant with more than `max_copied_share` of its parts in one verbatim piece."""


def run_search(task: Task) -> Outcome:
    """Search for variants of a kit, from its exemplars and the pools of earlier rounds on."""
    section = task.config.section(VariationsConfig)
    config = section.search
    kit = input_kit(task, task.shard.params["kit"])
    search = Search(input_oracle(task, kit.name), config, shares=_shares(task, kit, section.require.share_factor))
    rng = task.rng("tries")
    pool = PoolIndex.of(task, kit.name, len(kit.types))
    places = _fill_archive(pool, search)
    chosen = _draw_parents(rng, search.archive.crowds(places), config.max_parents, config.novelty.guided)
    for place, (found, index) in zip(places[chosen].tolist(), pool.variants(task, chosen), strict=True):
        (assembly, labels), origins = found.assembly(index), found.origins_of(index)
        if assembly.stretches is not None:  # no exemplar shows how stretched parts dock
            continue
        search.adopt(rng, search.parent(found.name_of(index), assembly, origins, (place[0], place[1]), labels))
    name, wanted, rows = task.shard.name, task.shard.params["wanted"], RowVariants(kit, section.rows)
    with_rows = search.with_rows(task.rng("rows"), rows, task.shard.params["rows"], name)
    variants, tries = search.run(
        rng,
        config.tries_per_round,
        wanted - len(with_rows),
        name,
        lambda count: task.progress(count, wanted),
        with_rows,
    )
    in_shares = [variant for variant in variants if search.keeps_shares(variant.assembly)]
    if len(in_shares) < len(variants):
        search.rejects[OUT_OF_PROPORTION] += len(variants) - len(in_shares)
    kept, resized = _required(task, kit, section, in_shares, search.rejects)
    write_variants(task, kit, variants, kept)
    rejects = dict(sorted(search.rejects.items()))
    for reason, count in rejects.items():
        task.reject(task.shard.name, reason, count=count)
    summary = {"found": len(kept), "tries": tries, "reserve": search.reserve, "rejects": rejects}
    for key, counts in (("crossings", search.crossings), ("lists", search.maker.lists), ("resized", resized)):
        summary[key] = dict(sorted(counts.items()))
    return Outcome(0, summary)


def _shares(task: Task, kit: Kit, factor: float) -> FloatArray | None:
    """Return the bounds of the labels that are kept; None without any."""
    kept = task.shard.params["keep_types"]
    labels = common_labels(kit) if kept is True else kept
    return share_bounds(kit, labels, factor) if labels else None


def _fill_archive(pool: PoolIndex, search: Search) -> np.ndarray:
    """Tell a search what the pool holds; return the place of each variant in the archive, int64 (k, 2)."""
    novelty = search.config.novelty
    places = []
    for counts, features, keys in zip(pool.counts, pool.features, pool.keys, strict=True):
        types = np.repeat(np.arange(len(counts)), counts)
        search.maker.remember(types, *keys.tolist())
        cell = cell_of_features(features, novelty.axes, novelty.resolution)
        places.append(search.archive.add(cell, search.maker.histogram(types)))
    return np.array(places, dtype=np.int64).reshape(-1, 2)


def _draw_parents(rng: np.random.Generator, crowds: np.ndarray, count: int, guided: bool) -> list[int]:
    """Draw at most `count` variants of the pool without replacement, the rare ones more often; ascending."""
    waits = rng.exponential(size=len(crowds)) * (crowds if guided else 1)
    return sorted(np.argsort(waits, kind="stable")[:count].tolist())


def _required(
    task: Task, kit: Kit, section: VariationsConfig, variants: Sequence[Variant], rejects: Counter[str]
) -> tuple[Sequence[Variant], Counter[str]]:
    """Return the variants that meet the requirements with their hubs restored, and counts of those that were resized.

    The others are added to `rejects` by reason. Resized variants are counted by the reason that resizing removed.
    """
    params = task.shard.params
    has_labels = labels_test(kit, params["labels"])
    whole = [variant for variant in variants if has_labels(variant.assembly)]
    novel = [variant for variant in whole if variant.lineage["copied"]["share"] <= params["max_copied_share"]]
    for reason, count in ((LABELS_MISSING, len(variants) - len(whole)), (TOO_MUCH_COPIED, len(whole) - len(novel))):
        if count:
            rejects[reason] += count
    kept, resized = _constrained(kit, section, novel, rejects)
    min_hubs, physical = _min_hubs(task.config, kit), section.require.physical(params["stable"])
    if not (physical.rooted or physical.stable or min_hubs):
        return kept, resized
    restorer, restored = hub_restorer(task, kit.name), []
    for variant in kept:
        shape = restorer.fit(variant.assembly)
        has_hubs = restorer.has_hubs(min_hubs, shape)
        fault = unmet_requirement(physical, kit_shape(kit, shape)) if has_hubs else HUBS_NOT_RESTORED
        if fault is None:
            restored.append(variant)
        else:
            rejects[fault] += 1
    return restored, resized


def _constrained(
    kit: Kit, section: VariationsConfig, variants: list[Variant], rejects: Counter[str]
) -> tuple[list[Variant], Counter[str]]:
    """Return the variants that meet the global constraints, if need be resized, and counts of the resized ones."""
    constraints, stretch, resized = section.require.constraints, section.search.stretch, Counter[str]()
    if not constraints:
        return variants, resized
    test, kept = build_test(kit, constraints), []
    repair = build_repair(kit, constraints, stretch.max_factor, stretch.rigid) if stretch.max_factor > 1 else None
    for variant in variants:
        reason = test(variant.assembly)
        if reason is None:
            kept.append(variant)
            continue
        repaired = None if repair is None else repair(variant.assembly)
        if repaired is None:
            rejects[reason] += 1
            continue
        kept.append(replace(variant, assembly=repaired, lineage={**variant.lineage, "deformed": True}))
        resized[reason] += 1
    return kept, resized


def _min_hubs(config: Config, kit: Kit) -> float:
    """Return how many hub parts a variant of `kit` must get back or, below 1, the share of what exemplars have."""
    stated = config.section(VariationsConfig).require.min_hubs
    if stated != "auto":
        return stated
    kits = config.section(ExemplarsConfig).kits
    return auto_min_hubs(next(kit_config for kit_config in kits if kit_config.name == kit.name), kit)
