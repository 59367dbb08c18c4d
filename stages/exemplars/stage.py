"""Stage `exemplars`: model files in, one kit a shard out: `<kit>.json`, `<kit>.tar`, `<kit>.png`."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any, get_args

from pipeline.paths import file_digest
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.exemplars.origins import exemplar_origins
from stages.exemplars.settings import ExemplarsConfig
from stages.shape.collection.origin import missing_licenses

BYTES_A_KIT = 8_000_000


def plan(plan: Plan) -> list[Shard]:
    """Return one shard a kit, rebuilt if its model files change; it reads the resolved settings of `auto` keys."""
    return [
        Shard(
            kit.name,
            {"kit": kit.name, "digests": [file_digest(shape.path) for shape in kit.shapes]},
            (f"autoconfig/{kit.name}",) if kit.auto_keys() else (),
        )
        for kit in plan.config.section(ExemplarsConfig).kits
    ]


def run_shard(task: Task) -> Outcome:
    """Read the models, build the kit and write it."""
    from stages.exemplars.build import build_kit
    from stages.exemplars.kit_figure import kit_figure
    from stages.exemplars.read import read_parts
    from stages.shape.kit import ContactKind
    from stages.shape.kit_files import write_kit

    section = task.config.section(ExemplarsConfig)
    config = next(kit for kit in section.kits if kit.name == task.shard.params["kit"])
    resolution: dict[str, Any] = {"resolved": {}, "reasons": {}}
    if config.auto_keys():
        resolution = json.loads(task.input("autoconfig", f"{config.name}.json").read_bytes())
        resolved = resolution["resolved"]
        config = config.resolve(resolved).model_copy(update={"parts": resolved.get("parts", config.parts)})
    texture_size = config.appearance.kept_texture_size
    models = [
        read_parts(shape.path, config.parts, section.limits, config.units, texture_size) for shape in config.shapes
    ]
    kit, observation = build_kit(config, models)
    kinds = [kind for of_exemplar in observation.kinds for kind in of_exemplar]
    with task.output(f"{kit.name}.json") as text, task.output(f"{kit.name}.tar") as arrays:
        write_kit(kit, text, arrays)
    with task.output(f"{kit.name}.png") as picture:
        picture.write(kit_figure(kit))
    return Outcome(
        samples=len(kit.exemplars),
        summary={
            "kit": kit.name,
            "types": len(kit.types),
            "parts": [len(exemplar.assembly) for exemplar in kit.exemplars],
            "contacts": {kind: kinds.count(kind) for kind in get_args(ContactKind)},
            "rules": sum(len(rules) for rules in kit.grammar.neighbourhoods.values()),
            "dockings": len(kit.grammar.dockings),
            "segmentation": [f"{model.path.name}: {model.segmentation}: {model.why}" for model in models],
            "repairs": observation.repairs,
            "aliases": {name: list(words) for name, words in observation.aliases.items()},
            "hubs": [kit.types[index].name for index in kit.grammar.hubs],
            "warnings": list(observation.warnings),
            "resolved": resolution["resolved"],
            "reasons": resolution["reasons"],
        },
    )


def report(plan: Plan) -> Sequence[str]:
    """Return lines for each kit: its counts, its aliases and its warnings."""
    lines = []
    for name in plan.shards("exemplars"):
        summary = plan.summary("exemplars", name)
        if summary is not None:
            parts = " + ".join(str(count) for count in summary["parts"])
            lines.append(
                f"{name}: {parts} parts of {summary['types']} types, {summary['rules']} neighbourhoods, "
                f"{summary['dockings']} dockings"
            )
            lines.extend(
                f"{name}: type {kind} is also called {', '.join(names)}" for kind, names in summary["aliases"].items()
            )
            lines.extend(f"{name}: warning: {warning}" for warning in summary["warnings"])
    lines.extend(f"warning: {sentence}" for sentence in missing_licenses(exemplar_origins(plan.config)))
    return lines


STAGE = Stage(
    name="exemplars",
    module=__name__,
    keep_output=True,
    config=ExemplarsConfig,
    inputs=("autoconfig",),
    plan=plan,
    run_shard=run_shard,
    estimate_bytes=lambda plan: BYTES_A_KIT * len(plan.config.section(ExemplarsConfig).kits),
    report=report,
)
