"""Stage `package`: the dataset folder that users load, made of what the stages before it made of each sample."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.package.compose import compose_dataset
from stages.package.layout import CARD, CHECKSUMS, CROISSANT, MANIFEST, PREVIEW, index_path
from stages.package.manifest import config_sections
from stages.package.merge import merge_shard, merged_stages
from stages.package.preview import draw_preview
from stages.package.settings import PackageConfig
from stages.shape.collection.shards import PRODUCERS, check_producers, collection_shards, planned_producer

__all__ = ["STAGE"]

VERSION = 4
WHOLE = "dataset"
PICTURE = "preview"
PICTURE_SHARDS = 8
"""The preview picture chooses from the samples of at most so many shards."""


def plan(plan: Plan) -> list[Shard]:
    """One shard for each of the collection; when these are done, the picture, and the files about the whole."""
    producer = planned_producer(plan)
    if producer is None:
        return []
    merged = collection_shards(plan, *merged_stages(producer))
    summaries = [plan.summary("package", shard.name) for shard in merged]
    if not merged or any(summary is None for summary in summaries):
        return merged
    described = [{"name": shard.name, **(summary or {})} for shard, summary in zip(merged, summaries, strict=True)]
    filled = [shard for shard in described if shard["samples"]]
    if not filled:
        return merged
    kits = tuple(f"exemplars/{name}" for name in plan.shards("exemplars"))
    shown = [shard["name"] for shard in filled[:PICTURE_SHARDS]]
    stages = (producer, "points", "sketches")
    pictured = {
        "title": plan.config.title or plan.config.name,
        "of": sum(shard["samples"] for shard in filled),
        "shards": shown,
    }
    picture = Shard(PICTURE, pictured, (*kits, *(f"{stage}/{name}" for name in shown for stage in stages)))
    params = {
        "facts": _facts(plan),
        "producer": producer,
        "sections": config_sections(plan.config),
        "shards": filled,
        "search": _search_endings(plan),
        "rejects": _rejects(plan, producer),
        "measures": _measures(plan),
        "preview": PICTURE,
        "package": VERSION,
    }
    inputs = (*kits, *(f"package/{shard['name']}" for shard in filled), f"package/{PICTURE}")
    return [*merged, picture, Shard(WHOLE, params, inputs)]


def run_shard(task: Task) -> Outcome:
    """Make one shard of the plan."""
    if task.shard.name == WHOLE:
        return compose_dataset(task)
    if task.shard.name == PICTURE:
        return draw_preview(task)
    return merge_shard(task)


def publish(plan: Plan) -> Mapping[str, str]:
    """The dataset's folder and the index beside it, by the files of the shards; nothing where no sample is left."""
    name = plan.config.name
    if WHOLE not in plan.shards("package"):
        return {}
    files = {f"{name}/{file}": f"{WHOLE}.{file}" for file in (CARD, CROISSANT, MANIFEST, CHECKSUMS)}
    files[f"{name}/{PREVIEW}"] = f"{PICTURE}.png"
    files[index_path(plan.config)] = f"{WHOLE}.parquet"
    for shard in plan.shards("package"):
        summary = plan.summary("package", shard)
        if summary is not None and summary.get("path") and summary["samples"]:
            files[f"{name}/{summary['path']}"] = f"{shard}.tar"
    return files


def report(plan: Plan) -> Sequence[str]:
    """What the finished dataset holds."""
    if plan.summary("package", WHOLE) is None:
        return []
    summaries = [plan.summary("package", shard) or {} for shard in plan.shards("package")]
    shards = [summary for summary in summaries if summary.get("path")]
    samples, size = sum(shard["samples"] for shard in shards), sum(shard["bytes"] for shard in shards) / 1e6
    return [f"dataset {plan.config.name}: {samples:,} samples in {len(shards)} shards, {size:,.1f} MB"]


def estimate_bytes(plan: Plan) -> int:
    """Bytes of all shards: what the stages before have made of each sample, and a mesh of a usual size."""
    samples = sum(int(shard.params["samples"]) for shard in collection_shards(plan))
    return samples * 300_000


def _search_endings(plan: Plan) -> list[str]:
    """How the search of each kit ended, in words, from the summaries of its last pool."""
    summaries = [plan.summary("variations", shard) or {} for shard in plan.shards("variations")]
    return [
        f"{each['why']}; {each['graphs']:,} distinct graphs, {each['histograms']:,} distinct histograms."
        for each in summaries
        if each.get("why")
    ]


def _rejects(plan: Plan, producer: str) -> dict[str, int]:
    """What the producer refused, by reason."""
    counts: Counter[str] = Counter()
    for shard in plan.shards(producer):
        counts.update(plan.rejects(producer, shard))
    return dict(sorted(counts.items()))


def _measures(plan: Plan) -> dict[str, Any]:
    """What the variants of each kit are worth, where they are variants."""
    assignment = f"{plan.config.name}-assignment"
    summary = plan.summary("variations", assignment) if assignment in plan.shards("variations") else None
    return dict(summary["kits"]) if summary is not None else {}


def _facts(plan: Plan) -> dict[str, Any]:
    config, section = plan.config, plan.config.section(PackageConfig)
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
        "task_categories": list(section.task_categories),
    }


STAGE = Stage(
    name="package",
    version=VERSION,
    config=PackageConfig,
    inputs=("exemplars", *PRODUCERS, "validity", "strings", "points", "sketches"),
    plan=plan,
    run_shard=run_shard,
    estimate_bytes=estimate_bytes,
    report=report,
    publish=publish,
    check=check_producers,
)
