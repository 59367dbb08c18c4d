"""Stage `sketches`: each sample of the collection becomes line drawings."""

from __future__ import annotations

from pipeline.errors import ShardFailed
from pipeline.shards import ShardWriter
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.shape.collection.shapes import Collection
from stages.shape.collection.shards import PRODUCERS, collection_shards
from stages.shape.sample import Sample
from stages.shape.views.buffers import Backend
from stages.shape.views.probe import backend_for
from stages.shape.views.scene import Scene, scene_of
from stages.sketches.draw import draw_sketch, jittered_camera
from stages.sketches.image import augment, png_bytes
from stages.sketches.settings import SketchesConfig

__all__ = ["STAGE", "SketchesConfig"]


def plan(plan: Plan) -> list[Shard]:
    """One shard for each shard of the collection."""
    return collection_shards(plan)


def run_shard(task: Task) -> Outcome:
    """Members of each sample: `sketch0.png`, `sketch1.png`, ..., one for each view.

    Raises ShardFailed, naming the sample, for a drawing without a line.
    """
    config = task.config.section(SketchesConfig)
    collection = Collection(task)
    backend = backend_for(config.backend)
    total = int(task.shard.params["samples"])
    with task.output(f"{task.shard.name}.tar") as stream, ShardWriter(stream) as writer:
        for sample in collection.samples():
            scene = scene_of(collection.shape(sample))
            writer.write(sample.key, _drawings(task, config, sample, scene, backend))
            task.progress(writer.samples, total)
    summary = {"split": task.shard.params["split"], "views": [view.name for view in config.views], "backend": backend}
    return Outcome(samples=writer.samples, summary=summary)


def _drawings(task: Task, config: SketchesConfig, sample: Sample, scene: Scene, backend: Backend) -> dict[str, bytes]:
    members = {}
    for index, view in enumerate(config.views):
        camera = jittered_camera(view, task.rng(sample.key, view.name, "camera"))
        try:
            drawing = draw_sketch(scene, camera, config.size, config.supersample, config.strokes, backend)
        except ShardFailed as error:
            raise ShardFailed(f"sample {sample.key}, view {view.name}: {error}") from error
        drawing = augment(drawing, config.augment, task.rng(sample.key, view.name, "augment"))
        if drawing.min() == drawing.max():
            raise ShardFailed(f"sample {sample.key}, view {view.name}: eroding by {config.augment.size} left no line")
        members[f"sketch{index}.png"] = png_bytes(drawing)
    return members


def estimate_bytes(plan: Plan) -> int:
    """Bytes of all drawings: about a fifth of a byte a pixel, and the tar's headers and padding."""
    config = plan.config.section(SketchesConfig)
    samples = sum(int(shard.params["samples"]) for shard in collection_shards(plan))
    return int(samples * len(config.views) * (0.2 * config.size**2 + 1024))


STAGE = Stage(
    name="sketches",
    module=__name__,
    config=SketchesConfig,
    inputs=("exemplars", *PRODUCERS),
    plan=plan,
    run_shard=run_shard,
    estimate_bytes=estimate_bytes,
)
