"""Stage `choices`: kits with keys left at `auto` in, what those come to out: `<kit>.json`."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from pipeline.config import Config
from pipeline.paths import file_digest
from pipeline.shards import json_bytes
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.autoconfig.settings import AutoconfigConfig
from stages.exemplars.settings import ExemplarsConfig, KitConfig
from stages.shape.resolved_settings import REQUIRED_LABELS_KEY
from stages.variations.fallback import allows_fallback
from stages.variations.settings import VariationsConfig

BYTES_A_KIT = 4_000


def plan(plan: Plan) -> list[Shard]:
    """One shard for each kit that leaves a key open; its params hold the kit's config, its models' digests, and what
    variants must be that is open, too."""
    variations = plan.config.section(VariationsConfig)
    left_open = variations.require.auto_keys if variations.samples_per_kit else ()
    if variations.search.sub_assemblies:  # what is asked for by this name has no carcass
        left_open = tuple(key for key in left_open if key != REQUIRED_LABELS_KEY)
    return [
        Shard(
            kit.name,
            {
                "kit": kit.model_dump(mode="json"),
                "digests": [file_digest(shape.path) for shape in kit.shapes],
                "require": list(left_open),
                "fallback": allows_fallback(plan.config),
            },
        )
        for kit in _open_kits(plan.config)
    ]


def run_shard(task: Task) -> Outcome:
    """Read the models and decide."""
    from stages.autoconfig.resize_fallback import resize_fallback
    from stages.autoconfig.resolved_kit import read_and_resolve
    from stages.inspection.report import foreseen
    from stages.shape.geometry.contact_oracle import ContactOracle

    config = KitConfig.model_validate_json(json.dumps(task.shard.params["kit"]))
    limits, tries = task.config.section(ExemplarsConfig).limits, task.config.section(AutoconfigConfig).max_tries
    reading = read_and_resolve(config, limits, tries, task.shard.params["require"])
    choices = reading.choices
    if task.shard.params["fallback"] and not choices.enough:
        built = reading.observe(choices.values)
        if not built.refusals:
            expected = foreseen(config, reading, ContactOracle(built.kit), tries)
            instead = resize_fallback(reading, expected, shown=0)
            choices = choices if instead is None else instead.choices
    made = choices.as_json()
    with task.output(f"{config.name}.json") as stream:
        stream.write(json_bytes(made))
    return Outcome(samples=0, summary=made)


def report(plan: Plan) -> Sequence[str]:
    """A line for each key that was chosen."""
    lines = []
    for name in plan.shards("autoconfig"):
        made = plan.summary("autoconfig", name)
        if made is not None:
            lines += [
                f"{name}: {key}: {_shown(each)}: {made['reasons'][key]}" for key, each in made["resolved"].items()
            ]
    return lines


def _shown(value: Any) -> str:
    return f"[{', '.join(value)}]" if isinstance(value, list) else str(value)


def _open_kits(config: Config) -> list[KitConfig]:
    return [kit for kit in config.section(ExemplarsConfig).kits if kit.auto_keys()]


STAGE = Stage(
    name="autoconfig",
    module=__name__,
    config=AutoconfigConfig,
    inputs=(),
    sections=("exemplars", "variations"),
    plan=plan,
    run_shard=run_shard,
    estimate_bytes=lambda plan: BYTES_A_KIT * len(_open_kits(plan.config)),
    report=report,
)
