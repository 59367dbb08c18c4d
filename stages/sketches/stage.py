"""Stage `sketches`: each sample of the collection becomes line drawings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from pipeline.config import Config
from pipeline.errors import ShardFailed
from pipeline.shards import ShardWriter
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.shape.collection.shapes import Collection
from stages.shape.collection.shards import PRODUCERS, collection_shards
from stages.shape.sample import Sample
from stages.shape.views.buffers import drawn_by
from stages.shape.views.probe import check_backend
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
    total = int(task.shard.params["samples"])
    with task.output(f"{task.shard.name}.tar") as stream, ShardWriter(stream) as writer:
        for sample in collection.samples():
            scene = scene_of(collection.shape(sample))
            writer.write(sample.key, _drawings(task, config, sample, scene))
            task.progress(writer.samples, total)
    summary = {
        "split": task.shard.params["split"],
        "views": [view.name for view in config.views],
        "backend": config.backend,
        "renderer": drawn_by(config.backend),
    }
    return Outcome(samples=writer.samples, summary=summary)


def _drawings(task: Task, config: SketchesConfig, sample: Sample, scene: Scene) -> dict[str, bytes]:
    members = {}
    for index, view in enumerate(config.views):
        camera = jittered_camera(view, task.rng(sample.key, view.name, "camera"))
        try:
            drawing = draw_sketch(scene, camera, config.size, config.supersample, config.strokes, config.backend)
        except ShardFailed as error:
            raise ShardFailed(f"sample {sample.key}, view {view.name}: {error}") from error
        drawing = augment(drawing, config.augment, task.rng(sample.key, view.name, "augment"))
        if drawing.min() == drawing.max():
            raise ShardFailed(f"sample {sample.key}, view {view.name}: eroding by {config.augment.size} left no line")
        members[f"sketch{index}.png"] = png_bytes(drawing)
    return members


def report(plan: Plan) -> Sequence[str]:
    """What drew the sketches: one line, or several where machines differ."""
    summaries = (plan.summary("sketches", name) for name in plan.shards("sketches"))
    drawn = Counter(f"{each['backend']}, {each['renderer']}" for each in summaries if each is not None)
    return [f"{count} shards drawn by {what}" for what, count in sorted(drawn.items())]


def check_machine(config: Config) -> None:
    """Raises ConfigError where the config's backend cannot draw: no other draws in its place."""
    check_backend(config.section(SketchesConfig).backend, f"{config.path}: sketches.backend")


def estimate_bytes(plan: Plan) -> int:
    """Bytes of all drawings: about a fifth of a byte a pixel, and the tar's headers and padding."""
    config = plan.config.section(SketchesConfig)
    samples = sum(int(shard.params["samples"]) for shard in collection_shards(plan))
    return int(samples * len(config.views) * (0.2 * config.size**2 + 1024))


STAGE = Stage(
    name="sketches",
    version=2,
    config=SketchesConfig,
    inputs=("exemplars", *PRODUCERS),
    plan=plan,
    run_shard=run_shard,
    estimate_bytes=estimate_bytes,
    report=report,
    check_machine=check_machine,
)
