"""The plan of a kit's search: rounds of parallel search shards, each followed by a pool shard that keeps what is new.

A round of a kit has search shards `<kit>-r<round>-lane<k>` and one pool shard `<kit>-r<round>-pool`. Searches draw
their parents from the pools of all earlier rounds. What a search does depends on its shard's name, which seeds its
random streams, and never on who runs it. Searches of the first round begin with exemplars whose rows are longer or
shorter.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Mapping
from typing import Any

from pipeline.stage import Plan, Shard
from stages.shape.resolved_settings import (
    KEEP_TYPES_KEY,
    MAX_COPIED_SHARE_KEY,
    REQUIRED_LABELS_KEY,
    STABLE_KEY,
    resolved_settings,
)
from stages.variations.constraint import module_of
from stages.variations.settings import VariationsConfig

MAX_VARIANTS_PER_SHARD = 400
"""Variants after which a search shard ends, so that searches exchange what they have found."""
MIN_VARIANTS_PER_SHARD = 32
TARGET_ROUNDS = 40
"""A large pool grows in larger steps than MAX_VARIANTS_PER_SHARD, so that it takes about this many rounds."""
COUNTERS = ("crossings", "lists", "rejects", "resized")
"""Counts by name that search shards report and pool shards add up."""


def search_shards(plan: Plan, kit: str) -> tuple[list[Shard], bool]:
    """Return the shards of a kit's search as far as they can be planned now, and whether the search has ended."""
    config = plan.config.section(VariationsConfig)
    searches = config.search.parallel_searches
    shards: list[Shard] = []
    inputs: list[str] = []
    state: Mapping[str, Any] = {"novel": 0, "tries": 0, "idle": 0, "curve": [], **{key: {} for key in COUNTERS}}
    target, required = math.ceil(config.selection.oversample * config.samples_per_kit), _required(plan, kit)
    for number in range(config.search.max_rounds):
        name = f"{kit}-r{number:03d}"
        wanted = max(MIN_VARIANTS_PER_SHARD, -(-(target - state["novel"]) * 11 // (10 * searches)))
        wanted = min(wanted, max(MAX_VARIANTS_PER_SHARD, target // (TARGET_ROUNDS * searches)))
        rows = 0 if number else math.ceil(config.rows.pool_share * wanted)
        round_shards = [
            Shard(
                search_name(name, k),
                {"job": "search", "kit": kit, "wanted": wanted, "rows": rows, **required},
                (f"exemplars/{kit}", *inputs),
                code=tuple(module_of(constraint) for constraint in config.require.constraints),
            )
            for k in range(searches)
        ]
        shards.extend(round_shards)
        inputs.extend(f"variations/{shard.name}" for shard in round_shards)
        summaries = [plan.summary("variations", shard.name) for shard in round_shards]
        done = [summary for summary in summaries if summary is not None]
        if len(done) < len(round_shards):
            return shards, False
        params = {
            "job": "pool",
            "kit": kit,
            "tried": sum(summary["tries"] for summary in done),
            "reserve": sum(summary["reserve"] for summary in done),
            "counted": {key: added_counts(*(summary[key] for summary in done)) for key in COUNTERS},
            "last": number == config.search.max_rounds - 1,
            **{key: state[key] for key in ("novel", "tries", "idle", "curve", *COUNTERS)},
        }
        pool = Shard(f"{name}-pool", params, (f"exemplars/{kit}", *inputs))
        shards.append(pool)
        inputs.append(f"variations/{pool.name}")
        pool_summary = plan.summary("variations", pool.name)
        if not pool_summary or pool_summary["ended"]:
            return shards, bool(pool_summary)
        state = pool_summary
    return shards, True


def search_name(round_name: str, k: int) -> str:
    """Return the name of the k-th search shard of a round `<kit>-r<round>`. It seeds random streams: keep it."""
    return f"{round_name}-lane{k:02d}"


def selection_name(kit: str) -> str:
    """Return the name of the shard that chooses the variants of a kit. It seeds random streams: keep it."""
    return f"{kit}-selection"


def last_pool(plan: Plan, kit: str) -> dict[str, Any]:
    """Return the summary of the newest pool of a kit, empty before the first."""
    newest: dict[str, Any] = {}
    for name in plan.shards("variations"):
        if re.fullmatch(rf"{kit}-r\d+-pool", name):
            newest = dict(plan.summary("variations", name) or newest)
    return newest


def added_counts(*counts: Mapping[str, int]) -> dict[str, int]:
    """Return the sums of counts by name, in order of the names."""
    total: Counter[str] = Counter()
    for count in counts:
        total.update(count)
    return dict(sorted(total.items()))


def _required(plan: Plan, kit: str) -> dict[str, Any]:
    """Return the requirements of a kit's variants that a config can leave at `auto`, as stated or as resolved."""
    section = plan.config.section(VariationsConfig)
    require = section.require
    resolved = resolved_settings(plan, kit)
    required: dict[str, Any] = {}
    for key, stated, default in (
        (MAX_COPIED_SHARE_KEY, require.max_copied_share, 1.0),
        (STABLE_KEY, require.stable, False),
        (REQUIRED_LABELS_KEY, require.labels, ()),
        (KEEP_TYPES_KEY, require.keep_types, not section.search.sub_assemblies),
    ):
        value = resolved.get(key, default) if stated == "auto" else stated
        required[key.removeprefix("require.")] = list(value) if isinstance(value, tuple) else value
    return required
