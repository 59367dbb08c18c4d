"""Stage `proportions`: exemplars in; the same in other proportions out, as the shards `<dataset>-<split>-<index>.tar`.

Its first shards, several for each kit, draw factors and keep those under which the exemplar holds together. Then one
shard chooses among them, the most different first, and assigns each to its split and shard. A sample carries no meshes:
its text is its factors, and `stages.proportions.text.shape_of_text` makes the shape.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from pipeline.config import Config
from pipeline.errors import ConfigError, ShardFailed
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.exemplars.origins import exemplar_origins
from stages.exemplars.settings import ExemplarsConfig
from stages.proportions.distinct_warps import DistinctWarps
from stages.proportions.settings import MAX_SAMPLES_PER_KIT, ProportionsConfig
from stages.proportions.text import proportion_text, read_proportions
from stages.proportions.warp import lattice_of, warped
from stages.proportions.warp_check import warp_fault
from stages.shape.collection.assignment import (
    SplitConfig,
    assign_splits,
    planned_collection,
    write_listed_samples,
    write_listings,
)
from stages.shape.collection.origin import missing_licenses
from stages.shape.graphs.canonical import graph_digest
from stages.shape.kit_input import input_kit
from stages.shape.resolved_settings import FALLBACK_STABLE_KEY
from stages.variations.fallback import resolved_fallback
from stages.variations.settings import VariationsConfig

BYTES_A_SAMPLE = 8_000
CANDIDATES_PER_SAMPLE = 2
"""Candidates that the choice has for each requested sample."""


def plan(plan: Plan) -> list[Shard]:
    """Return the searches of all kits, then the choice and, once that is made, the shards of the collection.

    Their params hold what they must make: the section requests it, or it replaces layouts.
    """
    config = _requested_config(plan)
    if not config.samples_per_kit:
        return []
    request = config.model_dump(mode="json", include={"samples_per_kit", "splits", "require"})
    searches = [
        Shard(
            _search_name(kit, number),
            {"job": "search", "kit": kit, "number": number, "request": request},
            (f"exemplars/{kit}",),
        )
        for kit in plan.shards("exemplars")
        for number in range(config.parallel_searches)
    ]
    inputs = (
        *(f"exemplars/{kit}" for kit in plan.shards("exemplars")),
        *(f"proportions/{shard.name}" for shard in searches),
    )
    params = {"job": "choice", "searches": [shard.name for shard in searches], "request": request}
    choice = Shard(choice_name(plan.config.name), params, inputs)
    summary = plan.summary("proportions", choice.name)
    if summary is None:
        return [*searches, choice]
    return [*searches, choice, *planned_collection(plan, summary["shards"], (f"proportions/{choice.name}",))]


def _requested_config(plan: Plan) -> ProportionsConfig:
    """Return the section, or the request for layouts that proportions replace.

    The latter has the number of samples and the splits of the layouts, and requires shapes as stable as the exemplars.
    """
    own, chosen = plan.config.section(ProportionsConfig), resolved_fallback(plan)
    if own.samples_per_kit or not chosen:
        return own
    layouts = plan.config.section(VariationsConfig)
    shared = SplitConfig(**layouts.splits.model_dump(include=set(SplitConfig.model_fields)))
    stable = own.require.stable or chosen[FALLBACK_STABLE_KEY]
    require = own.require.model_copy(update={"stable": stable})
    return own.model_copy(
        update={
            "samples_per_kit": min(layouts.samples_per_kit, MAX_SAMPLES_PER_KIT),
            "splits": shared,
            "require": require,
        }
    )


def _task_config(task: Task) -> ProportionsConfig:
    """Return the section with the plan's request."""
    request = ProportionsConfig.model_validate_json(json.dumps(task.shard.params["request"]))
    update = {key: getattr(request, key) for key in ("samples_per_kit", "splits", "require")}
    return task.config.section(ProportionsConfig).model_copy(update=update)


def _search_name(kit: str, number: int) -> str:
    """Return the shard of one search of a kit; its name selects the stream of random numbers."""
    return f"{kit}-lane{number:02}"


def choice_name(dataset: str) -> str:
    """Return the shard that chooses the shapes of a dataset."""
    return f"{dataset}-choice"


def run_shard(task: Task) -> Outcome:
    """Run a search, the choice, or a shard of the collection."""
    jobs = {"search": run_search, "choice": run_choice, "collection": run_collection}
    return jobs[task.shard.params["job"]](task)


def run_search(task: Task) -> Outcome:
    """Write `.txt`: the texts of shapes that hold together and meet the requirements, one a line."""
    from stages.shape.physics.judge import unmet_requirement

    config = _task_config(task)
    kit = input_kit(task, task.shard.params["kit"])
    exemplars = [exemplar.whole for exemplar in kit.exemplars]
    lattices = [lattice_of(kit, exemplar) for exemplar in exemplars]
    distinct = [DistinctWarps(lattice, config.min_difference) for lattice in lattices]
    wanted = -(-CANDIDATES_PER_SAMPLE * config.samples_per_kit // config.parallel_searches)
    texts: list[str] = []
    tries = 0
    while len(texts) < wanted and tries < config.oversample * wanted:
        index = tries % len(exemplars)
        tries += 1
        name, whole, lattice = kit.exemplars[index].name, exemplars[index], lattices[index]
        text = proportion_text(name, lattice.draw(task.rng("factors", tries), config.log_std, config.max_factor))
        warp = read_proportions(text)[1]
        if not distinct[index].is_new(warp):
            task.reject(text, "too near the exemplar or an earlier draw")
            continue
        shape = warped(kit, whole, lattice, warp)
        reason = warp_fault(kit, whole, shape) or unmet_requirement(config.require, shape)
        if reason is not None:
            task.reject(text, reason)
            continue
        distinct[index].add(warp)
        texts.append(text)
        task.progress(len(texts), wanted)
    with task.output(f"{task.shard.name}.txt") as stream:
        stream.write("".join(f"{text}\n" for text in texts).encode())
    return Outcome(0, {"tries": tries, "found": len(texts)})


def run_choice(task: Task) -> Outcome:
    """Write one file for each shard of the collection, `.<split>-<number>.jsonl`, one sample a line.

    Raises ShardFailed if there are no shapes.
    """
    config = _task_config(task)
    texts: dict[str, list[str]] = {}
    for search in task.shard.params["searches"]:
        kit = search.rpartition("-lane")[0]
        texts.setdefault(kit, []).extend(
            task.input("proportions", f"{search}.txt").read_text(encoding="utf-8").splitlines()
        )
    rows: list[dict[str, Any]] = []
    counts: dict[str, int] = {}
    files = {kit.name: [shape.path for shape in kit.shapes] for kit in task.config.section(ExemplarsConfig).kits}
    for name, of_kit in texts.items():
        kit = input_kit(task, name)
        chosen: list[dict[str, Any]] = []
        for number, (exemplar, path) in enumerate(zip(kit.exemplars, files[name], strict=True)):
            own = [text for text in of_kit if read_proportions(text)[0] == exemplar.name]
            distinct = DistinctWarps(lattice_of(kit, exemplar.whole), config.min_difference)
            for text in own:
                distinct.add(read_proportions(text)[1])
            count = len(range(number, config.samples_per_kit, len(kit.exemplars)))
            graph = kit.labelled(exemplar.assembly)
            digest = graph_digest(graph.types, graph.edges)
            for index in distinct.farthest_first(count):
                parents = ["/".join(path.parts[-2:])]
                row = {"kit": name, "graph": digest, "method": "proportions", "parents": parents, "text": own[index]}
                chosen.append(row)
        for number, row in enumerate(chosen):
            rows.append({"key": f"{name}-{number:06d}", **row})
        counts[name] = len(chosen)
    if not rows:
        raise ShardFailed(
            "no exemplar holds together in other proportions, or none differs enough; set proportions.log_std or "
            "proportions.min_difference smaller, or require less, or vary the layout: variations.samples_per_kit"
        )
    split_of = assign_splits([[row] for row in range(len(rows))], config.splits, task.rng("splits"))
    shards = write_listings(task, rows, split_of, config.splits)
    return Outcome(0, {"shards": shards, "shapes": counts})


def run_collection(task: Task) -> Outcome:
    """Write the samples of one shard."""
    return write_listed_samples(task, "proportions", choice_name(task.config.name))


def report(plan: Plan) -> Sequence[str]:
    """Return the number of shapes of each kit, the rejects, and warnings where there are fewer than requested."""
    config = _requested_config(plan)
    summary = plan.summary("proportions", choice_name(plan.config.name)) if config.samples_per_kit else None
    if summary is None:
        return []
    lines = []
    for kit, count in summary["shapes"].items():
        rejected: dict[str, int] = {}
        for search in range(config.parallel_searches):
            for reason, rejects in plan.rejects("proportions", _search_name(kit, search)).items():
                rejected[reason] = rejected.get(reason, 0) + rejects
        why = ", ".join(f"{rejects:,} {reason}" for reason, rejects in sorted(rejected.items()))
        lines.append(f"{kit}: {count:,} of {config.samples_per_kit:,} shapes; rejected: {why or 'none'}")
        if count < config.samples_per_kit:
            lines.append(
                f"warning: {kit} has fewer shapes than requested; lower proportions.min_difference, or "
                "raise proportions.oversample or log_std"
            )
    return [*lines, *(f"warning: {sentence}" for sentence in missing_licenses(exemplar_origins(plan.config)))]


def check(config: Config) -> None:
    """Raise ConfigError if shapes are requested and there are no exemplars."""
    if config.section(ProportionsConfig).samples_per_kit and not config.section(ExemplarsConfig).kits:
        raise ConfigError(
            f"{config.path}: proportions.samples_per_kit asks for shapes, and there are no exemplars.kits"
        )


def requested_samples(config: Config) -> Sequence[int]:
    """Return the shapes of each shard of the collection if all requested ones are found."""
    section = config.section(ProportionsConfig)
    return section.splits.shard_sizes(section.samples_per_kit * len(config.section(ExemplarsConfig).kits))


def trial(config: Config) -> ProportionsConfig:
    """Return a request for a few shapes of each kit."""
    section = config.section(ProportionsConfig)
    few = max(32 // max(len(config.section(ExemplarsConfig).kits), 1), 4)
    update = {
        "samples_per_kit": min(section.samples_per_kit, few),
        "parallel_searches": 1,
        "splits": section.splits.for_trial(),
    }
    return section.model_copy(update=update)


def estimate_bytes(plan: Plan) -> int:
    """Return the bytes of all texts, in their searches and in the collection."""
    return 2 * BYTES_A_SAMPLE * _requested_config(plan).samples_per_kit * len(plan.shards("exemplars"))


STAGE = Stage(
    name="proportions",
    module=__name__,
    config=ProportionsConfig,
    inputs=("exemplars",),
    sections=("variations",),
    plan=plan,
    run_shard=run_shard,
    estimate_bytes=estimate_bytes,
    report=report,
    check=check,
    requested_samples=requested_samples,
    trial_config=trial,
)
