"""Stage `variations`: kits in, many valid new assemblies out, as shards `<dataset>-<split>-<index>.tar`.

Its shards are the searches and pools of each kit's rounds, the selection of each kit's variants, the assignment of all
to shards, and the collection.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from pipeline.config import Config
from pipeline.errors import ConfigError
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.exemplars.settings import ExemplarsConfig
from stages.shape.collection.assignment import planned_collection
from stages.variations.constraint import unknown_in
from stages.variations.fallback import resolved_fallback
from stages.variations.report.measures import described, growth
from stages.variations.search.rounds import last_pool, search_shards, selection_name
from stages.variations.settings import VariationsConfig

BYTES_PER_VARIANT = 60_000


def plan(plan: Plan) -> list[Shard]:
    """Return the rounds and selection of every kit as far as they are known, then the assignment and the collection."""
    if (
        not plan.shards("exemplars")
        or not plan.config.section(VariationsConfig).samples_per_kit
        or resolved_fallback(plan)
    ):
        return []
    searches: list[Shard] = []
    selections: dict[str, Shard] = {}
    for kit in plan.shards("exemplars"):
        shards, ended = search_shards(plan, kit)
        searches.extend(shards)
        if ended:
            selections[kit] = _selection_shard(plan, kit, shards)
    shards = [*searches, *selections.values()]
    measures = {kit: plan.summary("variations", shard.name) for kit, shard in selections.items()}
    if len(measures) < len(plan.shards("exemplars")) or None in measures.values():
        return shards
    chosen = tuple(f"variations/{shard.name}" for shard in selections.values())
    assignment = Shard(f"{plan.config.name}-assignment", {"job": "assignment", "kits": measures}, chosen)
    return [*shards, assignment, *_collection_shards(plan, assignment, searches)]


def _selection_shard(plan: Plan, kit: str, searches: list[Shard]) -> Shard:
    """Return the shard that chooses the variants of a kit, planned once its search has ended."""
    end = last_pool(plan, kit)
    params = {"job": "selection", "kit": kit, "searched": {key: end[key] for key in ("curve", "crossings", "advice")}}
    inputs = (f"exemplars/{kit}", *(f"variations/{shard.name}" for shard in searches))
    return Shard(selection_name(kit), params, inputs)


def _collection_shards(plan: Plan, assignment: Shard, searches: list[Shard]) -> list[Shard]:
    """Return the shards of the collection, `<dataset>-<split>-<index>`; none before the assignment is made."""
    summary = plan.summary("variations", assignment.name)
    if summary is None:
        return []
    exemplars = [f"exemplars/{kit}" for kit in assignment.params["kits"]]
    found = [f"variations/{shard.name}" for shard in searches if shard.params["job"] == "search"]
    return planned_collection(plan, summary["shards"], (*exemplars, *found, f"variations/{assignment.name}"))


def run_shard(task: Task) -> Outcome:
    """Run a search, pool, selection, assignment or collection shard."""
    from stages.variations.search.pool_shard import run_pool
    from stages.variations.search.search_shard import run_search
    from stages.variations.selection.assignment import run_assignment, run_selection
    from stages.variations.selection.collection import run_collection

    jobs = {
        "search": run_search,
        "pool": run_pool,
        "selection": run_selection,
        "assignment": run_assignment,
        "collection": run_collection,
    }
    return jobs[task.shard.params["job"]](task)


def report(plan: Plan) -> Sequence[str]:
    """Return how far the search of each kit is, why it ended, and what was selected from the pool."""
    wanted = plan.config.section(VariationsConfig).samples_per_kit
    lines = []
    for kit in plan.shards("exemplars"):
        state = last_pool(plan, kit)
        if state:
            counts = f"{state['graphs']:,} distinct graphs, {state['histograms']:,} distinct histograms"
            progress = f"{kit}: {state['found']:,} found for {wanted:,} after {state['tries']:,} tries"
            lines.append(f"{state['ending'] or progress}; {counts}")
            if state["advice"]:
                lines.append(f"{kit}: {state['advice']}")
            if state["skipped"]:
                lines.append(f"{kit}: {state['skipped']}")
            lines.append(f"{kit}: growth of histograms: {growth(state['curve'])}")
    assignment = plan.summary("variations", f"{plan.config.name}-assignment") or {"kits": {}}
    for kit, selected in assignment["kits"].items():
        lines.append(f"{kit}: {described(selected)}")
        if selected["low_diversity"]:
            lines.append(f"{kit}: {selected['low_diversity']}")
    return lines


def check(config: Config) -> None:
    """Raise ConfigError for unknown constraints, and where hubs are required that a kit never restores."""
    wrong = unknown_in(config.section(VariationsConfig).require.constraints)
    if wrong:
        raise ConfigError(f"{config.path}: variations.require.constraints: {wrong}")
    if config.section(VariationsConfig).require.min_hubs in ("auto", 0):
        return
    for kit in config.section(ExemplarsConfig).kits:
        if kit.hubs.types == "none" or not kit.hubs.restore:
            raise ConfigError(
                f"{config.path}: variations.require.min_hubs asks for hubs, but kit {kit.name} restores none; "
                "set its hubs.types and hubs.restore, or do not require hubs"
            )


def asked(config: Config) -> Sequence[int]:
    """Return the number of variants of each shard of the collection if the search finds all that is asked for."""
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
        * BYTES_PER_VARIANT
        * plan.config.section(VariationsConfig).samples_per_kit
        * len(plan.shards("exemplars"))
    ),
    report=report,
    check=check,
    requested_samples=asked,
    trial_config=trial,
)
