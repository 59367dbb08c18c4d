"""Stage `proportions`: exemplars in; the same in other proportions out, as the shards `<dataset>-<split>-<index>.tar`.

Its first shards, some lanes for each kit, draw factors and keep those under which the exemplar holds together. Then one
chooses of them, those farthest apart first, and gives each its split and shard. A sample carries no meshes: its text is
its factors, and `stages.proportions.text.shape_of_text` makes the shape.
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
from stages.shape.physics.judge import unmet_requirement
from stages.shape.resolved_settings import FALLBACK_STABLE_KEY
from stages.variations.fallback import resolved_fallback
from stages.variations.settings import VariationsConfig

BYTES_A_SAMPLE = 8_000
CANDIDATES_PER_SAMPLE = 2
"""So many times the shapes wanted are found, for the choice."""


def plan(plan: Plan) -> list[Shard]:
    """The lanes of all kits; the choice; when that is made, the shards of the collection. What they are to make is in
    their params: it is asked for by the own section, or comes instead of layouts."""
    config = _wanted(plan)
    if not config.samples_per_kit:
        return []
    asked = config.model_dump(mode="json", include={"samples_per_kit", "splits", "require"})
    lanes = [
        Shard(f"{kit}-lane{lane:02}", {"job": "lane", "kit": kit, "lane": lane, "asked": asked}, (f"exemplars/{kit}",))
        for kit in plan.shards("exemplars")
        for lane in range(config.parallel_searches)
    ]
    inputs = (
        *(f"exemplars/{kit}" for kit in plan.shards("exemplars")),
        *(f"proportions/{shard.name}" for shard in lanes),
    )
    params = {"job": "choice", "lanes": [shard.name for shard in lanes], "asked": asked}
    choice = Shard(choice_name(plan.config.name), params, inputs)
    summary = plan.summary("proportions", choice.name)
    if summary is None:
        return [*lanes, choice]
    return [*lanes, choice, *planned_collection(plan, summary["shards"], (f"proportions/{choice.name}",))]


def _wanted(plan: Plan) -> ProportionsConfig:
    """The section, or where proportions come instead of layouts, with what is asked of these: how many, shared out how,
    and that they stand where the exemplars do."""
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


def _asked(task: Task) -> ProportionsConfig:
    """The section, with what the plan has asked for."""
    asked = ProportionsConfig.model_validate_json(json.dumps(task.shard.params["asked"]))
    update = {key: getattr(asked, key) for key in ("samples_per_kit", "splits", "require")}
    return task.config.section(ProportionsConfig).model_copy(update=update)


def choice_name(dataset: str) -> str:
    """The shard that chooses the shapes of a dataset."""
    return f"{dataset}-choice"


def run_shard(task: Task) -> Outcome:
    """A lane, the choice, or a shard of the collection."""
    jobs = {"lane": run_lane, "choice": run_choice, "collection": run_collection}
    return jobs[task.shard.params["job"]](task)


def run_lane(task: Task) -> Outcome:
    """File of the shard: `.txt`, a text a line of shapes that hold together and are what they must be."""
    config = _asked(task)
    kit = input_kit(task, task.shard.params["kit"])
    exemplars = [exemplar.whole for exemplar in kit.exemplars]
    lattices = [lattice_of(kit, exemplar) for exemplar in exemplars]
    drawn = [DistinctWarps(lattice, config.min_difference) for lattice in lattices]
    wanted = -(-CANDIDATES_PER_SAMPLE * config.samples_per_kit // config.parallel_searches)
    found: list[str] = []
    tries = 0
    while len(found) < wanted and tries < config.oversample * wanted:
        place = tries % len(exemplars)
        tries += 1
        name, whole, lattice = kit.exemplars[place].name, exemplars[place], lattices[place]
        text = proportion_text(name, lattice.draw(task.rng("factors", tries), config.log_std, config.max_factor))
        warp = read_proportions(text)[1]
        if not drawn[place].is_new(warp):
            task.reject(text, "nearly the exemplar, or one drawn before")
            continue
        shape = warped(kit, whole, lattice, warp)
        wrong = warp_fault(kit, whole, shape) or unmet_requirement(config.require, shape)
        if wrong is not None:
            task.reject(text, wrong)
            continue
        drawn[place].add(warp)
        found.append(text)
        task.progress(len(found), wanted)
    with task.output(f"{task.shard.name}.txt") as stream:
        stream.write("".join(f"{text}\n" for text in found).encode())
    return Outcome(0, {"tries": tries, "found": len(found)})


def run_choice(task: Task) -> Outcome:
    """Files of the shard: one for each shard of the collection, `.<split>-<number>.jsonl`, one sample a line. Raises
    ShardFailed where there are no shapes."""
    config = _asked(task)
    texts: dict[str, list[str]] = {}
    for lane in task.shard.params["lanes"]:
        kit = lane.rpartition("-lane")[0]
        texts.setdefault(kit, []).extend(task.input("proportions", f"{lane}.txt").read_text().splitlines())
    rows: list[dict[str, Any]] = []
    counts: dict[str, int] = {}
    files = {kit.name: [shape.path for shape in kit.shapes] for kit in task.config.section(ExemplarsConfig).kits}
    for name, of_kit in texts.items():
        kit = input_kit(task, name)
        chosen: list[dict[str, Any]] = []
        for number, (exemplar, path) in enumerate(zip(kit.exemplars, files[name], strict=True)):
            own = [text for text in of_kit if read_proportions(text)[0] == exemplar.name]
            drawn = DistinctWarps(lattice_of(kit, exemplar.whole), config.min_difference)
            for text in own:
                drawn.add(read_proportions(text)[1])
            share = len(range(number, config.samples_per_kit, len(kit.exemplars)))
            graph = kit.labelled(exemplar.assembly)
            digest = graph_digest(graph.types, graph.edges)
            for place in drawn.farthest_first(share):
                parents = ["/".join(path.parts[-2:])]
                row = {"kit": name, "graph": digest, "method": "proportions", "parents": parents, "text": own[place]}
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
    """How many shapes each kit has, what was refused, and where there are fewer than wanted."""
    config = _wanted(plan)
    made = plan.summary("proportions", choice_name(plan.config.name)) if config.samples_per_kit else None
    if made is None:
        return []
    lines = []
    for kit, count in made["shapes"].items():
        refused: dict[str, int] = {}
        for lane in range(config.parallel_searches):
            for reason, number in plan.rejects("proportions", f"{kit}-lane{lane:02}").items():
                refused[reason] = refused.get(reason, 0) + number
        why = ", ".join(f"{number:,} {reason}" for reason, number in sorted(refused.items()))
        lines.append(f"{kit}: {count:,} of {config.samples_per_kit:,} shapes; refused: {why or 'none'}")
        if count < config.samples_per_kit:
            lines.append(
                f"warning: {kit} has fewer shapes than wanted; set proportions.min_difference smaller, or "
                "proportions.oversample or spread larger"
            )
    return [*lines, *(f"warning: {sentence}" for sentence in missing_licenses(exemplar_origins(plan.config)))]


def check(config: Config) -> None:
    """Raises ConfigError where there is nothing that could have other proportions."""
    if config.section(ProportionsConfig).samples_per_kit and not config.section(ExemplarsConfig).kits:
        raise ConfigError(
            f"{config.path}: proportions.samples_per_kit asks for shapes, and there are no exemplars.kits"
        )


def asked(config: Config) -> Sequence[int]:
    """The shapes of each shard of the collection, if as many are found as are asked for."""
    section = config.section(ProportionsConfig)
    return section.splits.shard_sizes(section.samples_per_kit * len(config.section(ExemplarsConfig).kits))


def trial(config: Config) -> ProportionsConfig:
    """Few shapes of each kit."""
    section = config.section(ProportionsConfig)
    few = max(32 // max(len(config.section(ExemplarsConfig).kits), 1), 4)
    update = {"samples_per_kit": min(section.samples_per_kit, few), "lanes": 1, "splits": section.splits.for_trial()}
    return section.model_copy(update=update)


def estimate_bytes(plan: Plan) -> int:
    """Bytes of all texts, in their lanes and in the collection."""
    return 2 * BYTES_A_SAMPLE * _wanted(plan).samples_per_kit * len(plan.shards("exemplars"))


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
    requested_samples=asked,
    trial_config=trial,
)
