"""Stage `package`: the dataset folder that users load, merged from the members that all stages made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from pipeline.config import Config
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.package.layout import (
    CARD,
    CHECKSUMS,
    CLASSES,
    CROISSANT,
    MANIFEST,
    PREVIEW,
    SCHEMA,
    VERIFIER,
    index_path,
)
from stages.package.manifest import config_sections
from stages.package.member_descriptions import describe_members
from stages.package.merge import merge_shard
from stages.package.producer_text import producer_text
from stages.package.schema import record_schema
from stages.package.settings import PackageConfig
from stages.package.versions import code_version, library_versions
from stages.shape.collection.discovery import language_of, member_modules, members, producers
from stages.shape.collection.shards import (
    MEMBERS,
    PRODUCERS,
    check_producers,
    collection_shards,
    planned_producer,
    sample_count,
    sample_producers,
)
from stages.shape.views.renderer_check import check_renderer
from stages.sketches.settings import SketchesConfig

DATASET_SHARD = "dataset"
PREVIEW_SHARD = "preview"
MAX_PREVIEW_SHARDS = 8
BYTES_PER_SAMPLE = 300_000


def plan(plan: Plan) -> list[Shard]:
    """Plan one shard for each of the collection; after these, the preview and the files about the whole dataset."""
    producer = planned_producer(plan)
    if producer is None:
        return []
    merged = _merged(plan)
    summaries = [plan.summary("package", shard.name) for shard in merged]
    if not merged or any(summary is None for summary in summaries):
        return merged
    named = [{"name": shard.name, **(summary or {})} for shard, summary in zip(merged, summaries, strict=True)]
    filled = [shard for shard in named if shard["samples"]]
    if not filled:
        return merged
    makers, read = sample_producers(plan), language_of(producer).reads(plan)
    joined = {"joined": list(makers)} if producers()[producer].joins else {}
    preview_shards = [shard["name"] for shard in _previewed(filled)]
    added = [stage for stage in members() if preview_shards[0] in plan.shards(stage)]
    rows = [stage for stage in added if members()[stage].rows(plan.config)]
    preview = {
        "producer": producer,
        **joined,
        "title": plan.config.title or plan.config.name,
        "of": sum(shard["samples"] for shard in filled),
        "shards": preview_shards,
        "rows": rows,
    }
    preview_inputs = (*read, *(f"{stage}/{name}" for name in preview_shards for stage in (producer, *rows)))
    picture = Shard(PREVIEW_SHARD, preview, preview_inputs, member_modules())
    declared = [producers()[name] for name in dict.fromkeys((*makers, producer))]
    languages = list({language_of(name).name: language_of(name) for name in makers}.values())
    origins = list(dict.fromkeys(origin for maker in declared for origin in maker.origins(plan)))
    sharing = [name for name in makers if producers()[name].graphs_share_split(plan.config)]
    params = {
        "facts": dataset_facts(plan, added),
        "producer": producer,
        **joined,
        "sections": config_sections(plan.config),
        "shards": filled,
        "members": describe_members(plan.config, filled[0]["members"], languages),
        "schema": record_schema(plan.config, producer, joined.get("joined", ()), merged[0].params["stages"]),
        "graphs_share_split": sharing if joined else bool(sharing),
        "card_text": producer_text(plan, makers, producer, added, origins),
        "measures": {name: value for maker in declared for name, value in maker.measures(plan).items()},
        "preview": PREVIEW_SHARD,
        "software": {"shapemill": code_version(), "libraries": library_versions()},
        "origins": [asdict(origin) for origin in origins],
    }
    inputs = (*read, *(f"package/{shard['name']}" for shard in filled), f"package/{PREVIEW_SHARD}")
    return [*merged, picture, Shard(DATASET_SHARD, params, inputs, member_modules())]


def _merged(plan: Plan) -> list[Shard]:
    """Return the shards of the dataset; each reads the shard of its name of every stage that adds members."""
    shards = []
    planned = {stage: set(plan.shards(stage)) for stage in members()}
    for shard in collection_shards(plan):
        stages = [stage for stage, names in planned.items() if shard.name in names]
        params = {**shard.params, "stages": stages}
        inputs = (*shard.inputs, *(f"{stage}/{shard.name}" for stage in stages))
        shards.append(Shard(shard.name, params, inputs, member_modules()))
    return shards


def run_shard(task: Task) -> Outcome:
    """Make one shard of the plan."""
    if task.shard.name == DATASET_SHARD:
        from stages.package.compose import compose_dataset

        return compose_dataset(task)
    if task.shard.name == PREVIEW_SHARD:
        from stages.package.preview import draw_preview

        return draw_preview(task)
    return merge_shard(task)


def publish(plan: Plan) -> Mapping[str, str]:
    """Return the files of the dataset's folder and its index, by the files of shards; none without samples."""
    name = plan.config.name
    if DATASET_SHARD not in plan.shards("package"):
        return {}
    files = {
        f"{name}/{file}": f"{DATASET_SHARD}.{file}"
        for file in (CARD, CROISSANT, SCHEMA, CLASSES, VERIFIER, MANIFEST, CHECKSUMS)
    }
    files[f"{name}/{PREVIEW}"] = f"{PREVIEW_SHARD}.png"
    files[index_path(plan.config)] = f"{DATASET_SHARD}.parquet"
    for shard in plan.shards("package"):
        summary = plan.summary("package", shard)
        if summary is not None and summary.get("path") and summary["samples"]:
            files[f"{name}/{summary['path']}"] = f"{shard}.tar"
    return files


def report(plan: Plan) -> Sequence[str]:
    """Describe the finished dataset."""
    preview = plan.summary("package", PREVIEW_SHARD)
    if preview is None or plan.summary("package", DATASET_SHARD) is None:
        return []
    summaries = [plan.summary("package", shard) or {} for shard in plan.shards("package")]
    shards = [summary for summary in summaries if summary.get("path")]
    samples, size = sum(shard["samples"] for shard in shards), sum(shard["bytes"] for shard in shards) / 1e6
    return [
        f"dataset {plan.config.name}: {samples:,} samples in {len(shards)} shards, {size:,.1f} MB",
        f"preview drawn by {preview['renderer']}, {preview['renderer_version']}",
    ]


def check_environment(config: Config) -> None:
    """Raise ConfigError where the renderer of sketches and preview cannot draw."""
    check_renderer(config.section(SketchesConfig).renderer, f"{config.path}: sketches.renderer")


def estimate_bytes(plan: Plan) -> int:
    """Estimate the bytes of all shards."""
    return sample_count(plan) * BYTES_PER_SAMPLE


def _previewed(shards: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Return the first shards, at most MAX_PREVIEW_SHARDS; those with kits that no earlier one has come first."""
    known: set[str] = set()
    fresh: list[Mapping[str, Any]] = []
    others: list[Mapping[str, Any]] = []
    for shard in shards:
        (others if known.issuperset(shard["kits"]) else fresh).append(shard)
        known.update(shard["kits"])
    chosen = [*fresh, *others][: max(MAX_PREVIEW_SHARDS, len(fresh))]
    return [shard for shard in shards if shard in chosen]


def dataset_facts(plan: Plan, added: Sequence[str]) -> dict[str, Any]:
    config, section = plan.config, plan.config.section(PackageConfig)
    served = dict.fromkeys(task for stage in added for task in members()[stage].tasks(config))
    return {
        "name": config.name,
        "version": config.version,
        "seed": config.seed,
        "title": config.title or config.name,
        "description": config.description or "3D shapes, made by Shapemill.",
        "license": config.license,
        "creator": section.creator,
        "published": section.published,
        "tags": list(section.tags),
        "task_categories": list(section.task_categories or served),
    }


STAGE = Stage(
    name="package",
    module=__name__,
    config=PackageConfig,
    inputs=(PRODUCERS, MEMBERS),
    plan=plan,
    run_shard=run_shard,
    estimate_bytes=estimate_bytes,
    report=report,
    publish=publish,
    check=check_producers,
    check_environment=check_environment,
)
