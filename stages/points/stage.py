"""Stage `points`: each sample of the collection becomes a labelled point cloud."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pipeline.shards import array_bytes, json_bytes
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.points.settings import PointsConfig
from stages.shape.collection.collection import Collection, add_members
from stages.shape.collection.shards import PRODUCERS, collection_shards, sample_count
from stages.shape.sample import Sample


def plan(plan: Plan) -> list[Shard]:
    """Plan one shard for each shard of the collection, unless points are turned off."""
    return collection_shards(plan) if plan.config.section(PointsConfig).enabled else []


def run_shard(task: Task) -> Outcome:
    """Make the members of each sample that `members.py` declares."""
    from stages.points.cloud import normalization, sample_cloud

    config = task.config.section(PointsConfig)

    def cloud_members(collection: Collection, sample: Sample) -> Mapping[str, bytes]:
        shape = collection.shape(sample)
        cloud = sample_cloud(shape, config.uniform, config.farthest, config.pool, config.surface, task.rng(sample.key))
        moved = normalization(shape, config.normalize)
        points = (cloud.points - moved.centre) * moved.scale
        described = {
            "farthest": config.farthest,
            "uniform": config.uniform,
            "surface": config.surface,
            "centre": list(moved.centre),
            "scale": moved.scale,
        }
        return {
            "json": json_bytes({"points": described}),
            "points.npy": array_bytes(points.astype(np.float32)),
            "normals.npy": array_bytes(cloud.normals.astype(np.float32)),
            "labels.npy": array_bytes(cloud.labels),
            "instances.npy": array_bytes(cloud.instances),
        }

    return Outcome(add_members(task, cloud_members), {"split": task.shard.params["split"]})


def estimate_bytes(plan: Plan) -> int:
    """Return the bytes of all clouds: 28 a point, and the tar's headers and padding."""
    config = plan.config.section(PointsConfig)
    if not config.enabled:
        return 0
    return sample_count(plan) * (28 * (config.uniform + config.farthest) + 6144)


STAGE = Stage(
    name="points",
    module=__name__,
    config=PointsConfig,
    inputs=(PRODUCERS,),
    plan=plan,
    run_shard=run_shard,
    estimate_bytes=estimate_bytes,
)
