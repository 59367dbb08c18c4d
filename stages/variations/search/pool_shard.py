"""A pool shard: it keeps the new variants of a round's searches and says whether the search goes on."""

from __future__ import annotations

import math

import numpy as np

from pipeline.stage import Outcome, Task
from stages.shape.kit import Kit
from stages.shape.kit_input import input_kit
from stages.variations.report.advice import SAME_LAYOUT, what_keeps, what_was_left
from stages.variations.report.measures import pool_measures
from stages.variations.search.pool import FoundVariants, PoolIndex, write_kept
from stages.variations.search.rounds import COUNTERS, added_counts, search_name
from stages.variations.search.search import RESERVE_FACTOR
from stages.variations.settings import VariationsConfig

MAX_PATIENCE_TRIES, MIN_PATIENCE_TRIES = 200_000, 40_000
PATIENT_PARTS = 100
"""Tries take longer the more parts there are: exemplars of more parts than this have less than MAX_PATIENCE_TRIES."""
SLOW_FACTOR, SLOW_CHOICE_FACTOR = 10, 2
"""A search ends if, at the pace of the last round, the missing variants would take this many times the tries so far;
and so does a search with enough variants if those missing to choose from would."""


def run_pool(task: Task) -> Outcome:
    """Keep the new variants that the searches of a round found, in the order of the searches."""
    config = task.config.section(VariationsConfig)
    params = task.shard.params
    kit = input_kit(task, params["kit"])
    duplicates = config.search.duplicates
    before = PoolIndex.of(task, kit.name, len(kit.types))
    known = {
        _identity(counts, digests, duplicates) for counts, digests in zip(before.counts, before.digests, strict=True)
    }
    kept: list[tuple[int, int]] = []
    doubles = 0
    round_name = task.shard.name.removesuffix("-pool")
    searches = [FoundVariants.of(task, search_name(round_name, k)) for k in range(config.search.parallel_searches)]
    for k, found in enumerate(searches):
        for index in range(len(found)):
            identity = _identity(found.counts(index, len(kit.types)), found.digests[index], duplicates)
            if identity in known:
                doubles += 1
                continue
            known.add(identity)
            kept.append((k, index))
    if doubles:
        task.reject(task.shard.name, "found by another search too", count=doubles)
    new = write_kept(task, searches, kept, len(kit.types))
    counts = np.concatenate([before.counts, new["counts"]])
    features = np.concatenate([before.features, new["features"]])
    measures = pool_measures(counts, features, np.concatenate([before.digests, new["digests"]]), config.search.novelty)
    total = len(counts)
    tries = params["tries"] + params["tried"]
    idle = 0 if kept else params["idle"] + params["tried"]
    novel = params["novel"] + max(len(kept) - params["reserve"], 0)
    target = math.ceil(config.selection.oversample * config.samples_per_kit)
    missing = target - novel if total >= config.samples_per_kit else config.samples_per_kit - total
    pace = len(kept) / params["tried"]
    patience = _patience(kit, config)
    slow = tries >= patience and 0 < pace * _slow_factor(total, config) * tries < missing
    ended = novel >= target or total >= RESERVE_FACTOR * target or idle >= patience or params["last"] or slow
    counters = {key: added_counts(params[key], params["counted"][key]) for key in COUNTERS}
    poor = ended and total < config.samples_per_kit
    return Outcome(
        0,
        {
            "kit": kit.name,
            "found": total,
            "tries": tries,
            "idle": idle,
            "novel": novel,
            **measures,
            "curve": [*params["curve"], [tries, total, measures["histograms"]]],
            **counters,
            "skipped": what_was_left(counters["lists"]),
            "advice": f"{what_keeps(kit, counters['rejects'], tries)}, or {SAME_LAYOUT}" if poor else "",
            "ended": ended,
            "ending": _ending(kit, config, total, tries, idle, params["tried"] if slow else 0) if ended else "",
        },
    )


def _slow_factor(found: int, config: VariationsConfig) -> int:
    return SLOW_CHOICE_FACTOR if found >= config.samples_per_kit else SLOW_FACTOR


def _ending(kit: Kit, config: VariationsConfig, found: int, tries: int, idle: int, slow_tries: int) -> str:
    """Return why a search ended. slow_tries: tries of the last round if its pace was too slow to go on, else 0."""
    start = f"{kit.name}: {min(found, config.samples_per_kit):,} of {config.samples_per_kit:,}"
    if found >= config.selection.oversample * config.samples_per_kit:
        return f"{start} variants, chosen from {found:,} after {tries:,} tries"
    chosen = f", chosen from {found:,}" if found > config.samples_per_kit else ""
    if idle >= _patience(kit, config):
        return f"{start}{chosen}: no new variant in the last {idle:,} tries"
    if slow_tries:
        longer = f"{_slow_factor(found, config)} times as long as all {tries:,} so far"
        return f"{start}{chosen}: at the pace of the last {slow_tries:,} tries the rest would take more than {longer}"
    return f"{start}{chosen}: the search ended after {config.search.max_rounds} rounds"


def _patience(kit: Kit, config: VariationsConfig) -> int:
    """Return the tries without a new variant after which the search of a kit ends."""
    stated = config.search.patience
    if stated != "auto":
        return stated
    largest = max(len(exemplar.assembly) for exemplar in kit.exemplars)
    return min(MAX_PATIENCE_TRIES, max(MIN_PATIENCE_TRIES, MAX_PATIENCE_TRIES * PATIENT_PARTS // largest))


def _identity(counts: np.ndarray, digests: np.ndarray, duplicates: str) -> bytes:
    """Return what two variants share when they are the same by the config's rule."""
    return bytes(counts if duplicates == "histogram" else digests[int(duplicates == "docking")])
