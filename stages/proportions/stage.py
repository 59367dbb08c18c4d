"""Stage `proportions`: exemplars in; the same in other proportions out, as the shards `<dataset>-<split>-<index>.tar`.

Its first shards, several for each kit, draw factors and keep those under which the exemplar holds together. Then one
shard chooses among them, the most different first, and assigns each to its split and shard. A sample carries no meshes:
its text is its factors, and `stages.proportions.text.shape_of_text` makes the shape.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from pipeline.config import Config
from pipeline.errors import ConfigError, ShardFailed
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.exemplars.settings import ExemplarsConfig
from stages.proportions.choice import chosen_texts
from stages.proportions.settings import MAX_SAMPLES_PER_KIT, ProportionsConfig
from stages.proportions.text import ProportionShapes, proportion_text, read_proportions
from stages.proportions.warp_check import warp_fault
from stages.shape.collection.assignment import (
    SplitConfig,
    assign_splits,
    planned_collection,
    write_listed_samples,
    write_listings,
)
from stages.shape.kit_input import input_kit
from stages.shape.resolved_settings import FALLBACK_KEY, FALLBACK_STABLE_KEY, ROWS_FALLBACK
from stages.variations.fallback import resolved_fallback
from stages.variations.settings import VariationsConfig

BYTES_A_SAMPLE = 8_000
CANDIDATES_PER_SAMPLE = 2
"""Candidates that the choice has for each requested sample."""
MIN_GRAPHS_PER_SPLITS = 20
"""Shape graphs from which splits share none."""


def plan(plan: Plan) -> list[Shard]:
    """Return the searches of all kits, then the choice and, once that is made, the shards of the collection.

    Their params hold what they must make: the section requests it, or it replaces layouts.
    """
    config = _requested_config(plan)
    if not config.samples_per_kit:
        return []
    request = config.model_dump(mode="json", include={"samples_per_kit", "splits", "require"})
    with_rows = _changes_rows(plan)
    searches = [
        Shard(
            _search_name(kit, number),
            {"job": "search", "kit": kit, "number": number, "rows": with_rows, "request": request},
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


def _changes_rows(plan: Plan) -> bool:
    """Return whether rows become longer and shorter: as stated, or as resolved for layouts that are replaced."""
    use = plan.config.section(VariationsConfig).rows.use
    return resolved_fallback(plan).get(FALLBACK_KEY) == ROWS_FALLBACK if use == "auto" else use


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
    """Write `.txt`: the texts of shapes that hold together and meet the requirements, one a line.

    The exemplars take turns, and so do the layouts of one exemplar.
    """
    from stages.proportions.draws import draw_proportions, drawn_layouts
    from stages.shape.physics.judge import unmet_requirement

    config, rows = _task_config(task), task.config.section(VariationsConfig).rows
    kit = input_kit(task, task.shard.params["kit"])
    shapes = ProportionShapes(kit)
    wanted = -(-CANDIDATES_PER_SAMPLE * config.samples_per_kit // config.parallel_searches)

    def reject(exemplar: str, reason: str, count: int) -> None:
        task.reject(exemplar, reason, count=count)

    layouts = [
        drawn_layouts(
            shapes, exemplar.name, config, rows if task.shard.params["rows"] else None, wanted,
            partial(task.rng, "rows", number), partial(reject, exemplar.name),
        )
        for number, exemplar in enumerate(kit.exemplars)
    ]  # fmt: skip
    sides = [shapes.unwarped(exemplar.name, ()).lattice.sides for exemplar in kit.exemplars]
    texts: list[str] = []
    tries = 0
    while len(texts) < wanted and tries < config.oversample * wanted:
        exemplar = tries % len(layouts)
        layout = layouts[exemplar][tries // len(layouts) % len(layouts[exemplar])]
        tries += 1
        name, rng = kit.exemplars[exemplar].name, task.rng("factors", tries)
        text = proportion_text(draw_proportions(name, layout, sides[exemplar], rng, config, rows))
        warp = read_proportions(text).warp
        if not layout.is_new(warp):
            task.reject(text, "too near the exemplar or an earlier draw")
            continue
        shape = shapes.warped(layout.unwarped, warp)
        reason = warp_fault(kit, layout.unwarped.assembly, shape) or unmet_requirement(config.require, shape)
        if reason is not None:
            task.reject(text, reason)
            continue
        layout.distinct.add(warp)
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
    layouts: dict[str, int] = {}
    files = {kit.name: [shape.path for shape in kit.shapes] for kit in task.config.section(ExemplarsConfig).kits}
    for name, of_kit in texts.items():
        shapes = ProportionShapes(input_kit(task, name))
        exemplars = shapes.kit.exemplars
        chosen: list[dict[str, Any]] = []
        for number, (exemplar, path) in enumerate(zip(exemplars, files[name], strict=True)):
            own = [text for text in of_kit if read_proportions(text).exemplar == exemplar.name]
            count = len(range(number, config.samples_per_kit, len(exemplars)))
            parents = ["/".join(path.parts[-2:])]
            for text, graph in chosen_texts(shapes, own, count, config.min_difference):
                method = "rows" if read_proportions(text).changes else "proportions"
                chosen.append({"kit": name, "graph": graph, "method": method, "parents": parents, "text": text})
        for number, row in enumerate(chosen):
            rows.append({"key": f"{name}-{number:06d}", **row})
        counts[name] = len(chosen)
        layouts[name] = len({row["graph"] for row in chosen})
    if not rows:
        raise ShardFailed(
            "no exemplar holds together in other proportions, or none differs enough; set proportions.log_std or "
            "proportions.min_difference smaller, or require less, or vary the layout: variations.samples_per_kit"
        )
    split_of = assign_splits(_split_groups(rows), config.splits, task.rng("splits"))
    shards = write_listings(task, rows, split_of, config.splits)
    return Outcome(0, {"shards": shards, "shapes": counts, "layouts": layouts})


def _split_groups(rows: Sequence[Mapping[str, Any]]) -> list[list[int]]:
    """Return which rows share a split: those of one graph where there are enough graphs, otherwise each is alone."""
    groups: dict[tuple[str, str], list[int]] = {}
    for number, row in enumerate(rows):
        groups.setdefault((row["kit"], row["graph"]), []).append(number)
    return list(groups.values()) if splits_by_layout(len(groups)) else [[row] for row in range(len(rows))]


def splits_by_layout(layouts: int) -> bool:
    """Return whether shapes of one layout share a split: where there are enough layouts for all splits."""
    return layouts >= MIN_GRAPHS_PER_SPLITS


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
        layouts = summary["layouts"][kit]
        of_layouts = f" of {layouts:,} layouts" if layouts > 1 else ""
        lines.append(f"{kit}: {count:,} of {config.samples_per_kit:,} shapes{of_layouts}; rejected: {why or 'none'}")
        if count < config.samples_per_kit:
            lines.append(
                f"warning: {kit} has fewer shapes than requested; lower proportions.min_difference, or "
                "raise proportions.oversample or log_std"
            )
    return lines


def check(config: Config) -> None:
    """Raise ConfigError if shapes are requested and there are no exemplars."""
    if config.section(ProportionsConfig).samples_per_kit and not config.section(ExemplarsConfig).kits:
        raise ConfigError(
            f"{config.path}: proportions.samples_per_kit asks for shapes, and there are no exemplars.kits; name your "
            "models there, such as `kits: [{name: chairs, shapes: [chair.glb]}]`"
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
