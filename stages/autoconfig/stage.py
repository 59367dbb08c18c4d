"""Stage `autoconfig`: kits with keys left at `auto` in, their resolved settings out: `<kit>.json`."""

from __future__ import annotations

import json
from collections.abc import Sequence

from pipeline.config import Config
from pipeline.paths import file_digest
from pipeline.shards import json_bytes
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.autoconfig.settings import AutoconfigConfig
from stages.exemplars.settings import ExemplarsConfig, KitConfig
from stages.shape.resolved_settings import KEEP_TYPES_KEY, REQUIRED_LABELS_KEY
from stages.variations.fallback import allows_fallback
from stages.variations.settings import VariationsConfig

BYTES_A_KIT = 4_000


def plan(plan: Plan) -> list[Shard]:
    """Return one shard for each kit with an `auto` key.

    Its params hold the kit's config, the digests of its models, the requirements of variants that are `auto`, and
    whether the exemplars may be resized instead.
    """
    variations = plan.config.section(VariationsConfig)
    require = variations.require.auto_keys if variations.samples_per_kit else ()
    if variations.search.sub_assemblies:  # a requested piece of an exemplar need not have its labels
        require = tuple(key for key in require if key not in (REQUIRED_LABELS_KEY, KEEP_TYPES_KEY))
    return [
        Shard(
            kit.name,
            {
                "kit": kit.model_dump(mode="json"),
                "digests": [file_digest(shape.path) for shape in kit.shapes],
                "require": list(require),
                "fallback": allows_fallback(plan.config),
            },
        )
        for kit in _auto_kits(plan.config)
    ]


def run_shard(task: Task) -> Outcome:
    """Read the models and resolve the settings."""
    from stages.autoconfig.resize_fallback import resize_fallback
    from stages.autoconfig.resolved_kit import read_and_resolve
    from stages.shape.geometry.contact_oracle import ContactOracle

    config = KitConfig.model_validate_json(json.dumps(task.shard.params["kit"]))
    limits, tries = task.config.section(ExemplarsConfig).limits, task.config.section(AutoconfigConfig).max_tries
    resolved = read_and_resolve(config, limits, tries, task.shard.params["require"])
    resolution = resolved.resolution
    if task.shard.params["fallback"]:
        built = resolved.observe(resolution.values)
        if not built.refusals:
            enough = resolution.is_sufficient
            layouts = None if enough else resolved.estimate(config, ContactOracle(built.kit), tries)
            fallback = resize_fallback(resolved, layouts, max_shapes=0)
            resolution = resolution if fallback is None else fallback.resolution
    summary = resolution.as_json()
    with task.output(f"{config.name}.json") as stream:
        stream.write(json_bytes(summary))
    return Outcome(samples=0, summary=summary)


def report(plan: Plan) -> Sequence[str]:
    """Return a line for each resolved key."""
    lines = []
    for name in plan.shards("autoconfig"):
        summary = plan.summary("autoconfig", name) or {"resolved": {}}
        for key, value in summary["resolved"].items():
            shown = f"[{', '.join(value)}]" if isinstance(value, list) else value
            lines.append(f"{name}: {key}: {shown}: {summary['reasons'][key]}")
    return lines


def _auto_kits(config: Config) -> list[KitConfig]:
    return [kit for kit in config.section(ExemplarsConfig).kits if kit.auto_keys()]


STAGE = Stage(
    name="autoconfig",
    module=__name__,
    config=AutoconfigConfig,
    inputs=(),
    sections=("exemplars", "variations"),
    plan=plan,
    run_shard=run_shard,
    estimate_bytes=lambda plan: BYTES_A_KIT * len(_auto_kits(plan.config)),
    report=report,
)
