"""Stage `sketches`: each sample of the collection becomes line drawings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from pipeline.config import Config
from pipeline.errors import ShardFailed
from pipeline.shards import json_bytes
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.shape.collection.collection import Collection, add_members
from stages.shape.collection.shards import PRODUCERS, collection_shards, sample_count
from stages.shape.sample import Sample
from stages.shape.views.buffers import renderer_version
from stages.shape.views.camera_record import camera_fields
from stages.shape.views.image_files import png_bytes
from stages.shape.views.renderer_check import check_renderer
from stages.shape.views.scene import Scene, scene_of
from stages.sketches.draw import draw_sketch, jittered_camera
from stages.sketches.image import augment
from stages.sketches.settings import SketchesConfig


def plan(plan: Plan) -> list[Shard]:
    """Plan one shard for each shard of the collection, unless sketches are turned off or have no views."""
    section = plan.config.section(SketchesConfig)
    return collection_shards(plan) if section.enabled and section.views else []


def run_shard(task: Task) -> Outcome:
    """Make the members of each sample that `members.py` declares.

    Raises ShardFailed, naming the sample, for a drawing without a line.
    """
    config = task.config.section(SketchesConfig)

    def sketch_members(collection: Collection, sample: Sample) -> Mapping[str, bytes]:
        return drawings(task, config, sample, scene_of(collection.shape(sample)))

    samples = add_members(task, sketch_members)
    summary = {
        "split": task.shard.params["split"],
        "views": [view.name for view in config.views],
        "renderer": config.renderer,
        "renderer_version": renderer_version(config.renderer),
    }
    return Outcome(samples, summary)


def drawings(task: Task, config: SketchesConfig, sample: Sample, scene: Scene) -> dict[str, bytes]:
    """Return the members of one sample. Raises ShardFailed for a drawing without a line."""
    strokes = config.strokes
    widest = max(strokes.outline, strokes.contour, strokes.boundary, strokes.crease, 1.0)
    members: dict[str, bytes] = {}
    described = []
    for index, view in enumerate(config.views):
        camera = jittered_camera(view, task.rng(sample.key, view.name, "camera"))
        try:
            drawing, seen = draw_sketch(scene, camera, config.size, config.supersample, strokes, config.renderer)
        except ShardFailed as error:
            raise ShardFailed(f"sample {sample.key}, view {view.name}: {error}") from error
        drawing, flipped, thicker = augment(drawing, config.augment, task.rng(sample.key, view.name, "augment"))
        if drawing.min() == drawing.max():
            raise ShardFailed(f"sample {sample.key}, view {view.name}: eroding by {config.augment.size} left no line")
        members[f"sketch{index}.png"] = png_bytes(drawing)
        fields = {**camera_fields(seen, config.size, config.size, flipped), "flipped": flipped}
        described.append({"view": view.name, **fields, "line_width": float(widest + thicker)})
    return {"json": json_bytes({"sketches": described}), **members}


def report(plan: Plan) -> Sequence[str]:
    """Return what drew the sketches: one line, or several if machines differ."""
    summaries = (plan.summary("sketches", name) for name in plan.shards("sketches"))
    counts = Counter(
        f"{summary['renderer']}, {summary['renderer_version']}" for summary in summaries if summary is not None
    )
    return [f"{count} shards drawn by {what}" for what, count in sorted(counts.items())]


def check_machine(config: Config) -> None:
    """Raise ConfigError if the config's renderer cannot draw: no other takes its place."""
    check_renderer(config.section(SketchesConfig).renderer, f"{config.path}: sketches.renderer")


def estimate_bytes(plan: Plan) -> int:
    """Return the bytes of all drawings: about a fifth of a byte a pixel, and the tar's headers and padding."""
    config = plan.config.section(SketchesConfig)
    if not config.enabled:
        return 0
    return int(sample_count(plan) * len(config.views) * (0.2 * config.size**2 + 1024))


STAGE = Stage(
    name="sketches",
    module=__name__,
    config=SketchesConfig,
    inputs=(PRODUCERS,),
    plan=plan,
    run_shard=run_shard,
    estimate_bytes=estimate_bytes,
    report=report,
    check_environment=check_machine,
)
