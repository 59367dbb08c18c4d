"""Stage `variations`: kits in; many valid new assemblies out, as the shards `<dataset>-<split>-<index>.tar`.

Its shards are the lanes and pools of each kit's search, the assignment of variants to splits, and the collection.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from pipeline.config import Config
from pipeline.errors import ConfigError
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.exemplars.settings import ExemplarsConfig
from stages.variations.constraint import unknown_in
from stages.variations.fallback import resolved_fallback
from stages.variations.report.measures import described, growth
from stages.variations.search.rounds import last_pool, run_lane, run_pool, search_shards
from stages.variations.selection.collection import (
    assignment_shard,
    collection_shards_of,
    run_assignment,
    run_collection,
)
from stages.variations.settings import VariationsConfig

BYTES_A_VARIANT = 60_000

_JOBS = {"lane": run_lane, "pool": run_pool, "assignment": run_assignment, "collection": run_collection}


def plan(plan: Plan) -> list[Shard]:
    """The rounds of every kit as far as they are known, then the assignment and the collection."""
    if (
        not plan.shards("exemplars")
        or not plan.config.section(VariationsConfig).samples_per_kit
        or resolved_fallback(plan)
    ):
        return []
    search: list[Shard] = []
    ended = True
    for kit in plan.shards("exemplars"):
        shards, kit_ended = search_shards(plan, kit)
        search.extend(shards)
        ended = ended and kit_ended
    if not ended:
        return search
    assignment = assignment_shard(plan, search)
    return [*search, assignment, *collection_shards_of(plan, assignment)]


def run_shard(task: Task) -> Outcome:
    """One lane, pool, assignment or collection shard."""
    return _JOBS[task.shard.params["job"]](task)


def report(plan: Plan) -> Sequence[str]:
    """How far the search of each kit is, why it ended, and what was chosen from what it found."""
    wanted = plan.config.section(VariationsConfig).samples_per_kit
    lines = []
    for kit in plan.shards("exemplars"):
        state = last_pool(plan, kit)
        if state:
            counts = f"{state['graphs']:,} distinct graphs, {state['histograms']:,} distinct histograms"
            why = state["why"] or f"{kit}: {state['found']:,} found for {wanted:,} after {state['tries']:,} tries"
            lines.append(f"{why}; {counts}")
            if state["advice"]:
                lines.append(f"{kit}: {state['advice']}")
            if state["left"]:
                lines.append(f"{kit}: {state['left']}")
            lines.append(f"{kit}: growth of histograms: {growth(state['curve'])}")
    assignment = plan.summary("variations", f"{plan.config.name}-assignment") or {"kits": {}}
    for kit, chosen in assignment["kits"].items():
        lines.append(f"{kit}: {described(chosen)}")
        if chosen["dull"]:
            lines.append(f"{kit}: {chosen['dull']}")
    return lines


def check(config: Config) -> None:
    """Raises ConfigError for constraints that nobody knows, and where hubs are required that a kit does not put back:
    nothing would ever be kept."""
    wrong = unknown_in(config.section(VariationsConfig).require.constraints)
    if wrong:
        raise ConfigError(f"{config.path}: variations.require.constraints: {wrong}")
    if config.section(VariationsConfig).require.min_hubs in ("auto", 0):
        return
    for kit in config.section(ExemplarsConfig).kits:
        if kit.hubs.types == "none" or (not (kit.hubs.restore)):
            raise ConfigError(
                f"{config.path}: variations.require.min_hubs asks for hubs, and kit {kit.name} puts none back; "
                "set its hubs.types and hubs.restore, or do not require them"
            )


def asked(config: Config) -> Sequence[int]:
    """The variants of each shard of the collection, if the search finds as many as it is asked for."""
    section = config.section(VariationsConfig)
    return section.splits.shard_sizes(section.samples_per_kit * len(config.section(ExemplarsConfig).kits))


def trial(config: Config) -> VariationsConfig:
    """A search for few variants of each kit."""
    section, kits = config.section(VariationsConfig), len(config.section(ExemplarsConfig).kits)
    if not section.samples_per_kit:
        return section
    return section.model_copy(
        update={"samples_per_kit": max(32 // max(kits, 1), 4), "splits": section.splits.for_trial()}
    )


STAGE = Stage(
    name="variations",
    module=__name__,
    config=VariationsConfig,
    inputs=("exemplars",),
    plan=plan,
    run_shard=run_shard,
    estimate_bytes=lambda plan: (
        (1 + math.ceil(plan.config.section(VariationsConfig).selection.oversample))
        * BYTES_A_VARIANT
        * plan.config.section(VariationsConfig).samples_per_kit
        * len(plan.shards("exemplars"))
    ),
    report=report,
    check=check,
    requested_samples=asked,
    trial_config=trial,
)
