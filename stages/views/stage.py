"""Stage `views`: each sample of the collection becomes rendered images, if the config has cameras."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pipeline.shards import json_bytes
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.shape.collection.collection import Collection, add_members
from stages.shape.collection.shards import PRODUCERS, collection_shards, sample_count
from stages.shape.sample import Sample
from stages.shape.shape import Shape
from stages.shape.views.scene import scene_of
from stages.views.cameras import sample_views
from stages.views.render import ViewRenderer
from stages.views.settings import ViewsConfig, view_count

BYTES_PER_PIXEL = 0.5
"""Of one image, on average."""


def plan(plan: Plan) -> list[Shard]:
    """Plan one shard for each shard of the collection, if the config has cameras."""
    return collection_shards(plan) if plan.config.section(ViewsConfig).cameras else []


def run_shard(task: Task) -> Outcome:
    """Make the members of each sample that `members.py` declares.

    A sample that a camera does not see is rejected.
    """
    config = task.config.section(ViewsConfig)

    def images(collection: Collection, sample: Sample) -> Mapping[str, bytes]:
        return view_members(task, config, sample.key, collection.shape(sample))

    return Outcome(add_members(task, images), {"split": task.shard.params["split"], "views": view_count(config)})


def view_members(task: Task, config: ViewsConfig, key: str, shape: Shape) -> dict[str, bytes]:
    """Return the members of one sample. Raises Rejected where a camera sees nothing of the shape."""
    from stages.views.images import view_files
    from stages.views.placement import bounding_sphere
    from stages.views.shading import lamp_of

    scene, color = scene_of(shape), config.color
    sphere = bounding_sphere(scene)
    lamp = None
    if "color" in config.images and color.lighting == "lit":
        lamp = lamp_of(scene, sphere, color.light_azimuth, color.light_elevation, color.shadows)
    members: dict[str, bytes] = {}
    described: list[dict[str, Any]] = []
    views = sample_views(config, sphere, lambda entry: task.rng(key, "cameras", entry))
    for index, (kind, view) in enumerate(views):
        renderer = ViewRenderer(scene, view, config.width, config.height)
        files, fields = view_files(config, renderer, lamp, shape.part_classes, index)
        members |= files
        described.append({"cameras": kind, **fields})
    return {"json": json_bytes({"views": described}), **members}


def report(plan: Plan) -> Sequence[str]:
    """Return the number of views of a sample and their images."""
    config = plan.config.section(ViewsConfig)
    if not plan.shards("views"):
        return []
    size = f"{config.width} × {config.height}"
    return [f"{view_count(config)} views a sample, {size}, each with {', '.join(config.images)}"]


def estimate_bytes(plan: Plan) -> int:
    """Return the bytes of all images, and of the tar's headers and padding."""
    config = plan.config.section(ViewsConfig)
    image = BYTES_PER_PIXEL * config.width * config.height + 1024
    return int(sample_count(plan) * view_count(config) * len(config.images) * image)


STAGE = Stage(
    name="views",
    module=__name__,
    config=ViewsConfig,
    inputs=(PRODUCERS,),
    plan=plan,
    run_shard=run_shard,
    estimate_bytes=estimate_bytes,
    report=report,
)
