"""Stage `points`: each sample of the collection becomes a labelled point cloud."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from pipeline.config import StrictModel
from pipeline.shards import ShardWriter, array_bytes, json_bytes
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.points.cloud import sample_cloud
from stages.points.frame import Normalization, normalization
from stages.points.surface import SurfacePoints
from stages.shape.collection.shapes import Collection
from stages.shape.collection.shards import PRODUCERS, collection_shards

__all__ = ["STAGE", "PointsConfig"]


class PointsConfig(StrictModel):
    """How many points each sample gets, and where they lie."""

    uniform: int = Field(
        2048, ge=0, le=1_000_000, description="points drawn uniformly by area; unit: points (0: none of this kind)"
    )
    farthest: int = Field(
        0,
        ge=0,
        le=100_000,
        description="points picked by farthest-point sampling out of `pool`; they stand before the uniform ones; "
        "unit: points (0: none of this kind)",
    )
    pool: int = Field(
        30_000, ge=1, le=10_000_000, description="uniform points that the farthest are picked from; unit: points"
    )
    normalize: Literal["none", "unit_sphere", "unit_box"] = Field(
        "none",
        description="none: the coordinates of the mesh, in the kit's units; unit_box: box centred at the origin, "
        "longest side 1; unit_sphere: box centred at the origin, farthest vertex at distance 1",
    )

    @model_validator(mode="after")
    def _some_points(self) -> PointsConfig:
        if self.uniform + self.farthest == 0:
            raise ValueError("uniform and farthest are both 0: a cloud needs points")
        if self.farthest > self.pool:
            raise ValueError(f"farthest ({self.farthest}) is more than pool ({self.pool}) holds")
        return self


def plan(plan: Plan) -> list[Shard]:
    """One shard for each shard of the collection."""
    return collection_shards(plan)


def run_shard(task: Task) -> Outcome:
    """Members of each sample: `points.npy`, `normals.npy` float32 (n, 3), `labels.npy`, `instances.npy` int16 (n,),
    and `json`: how many points stand in which order, and how they were moved."""
    config = task.config.section(PointsConfig)
    collection = Collection(task)
    total = int(task.shard.params["samples"])
    with task.output(f"{task.shard.name}.tar") as stream, ShardWriter(stream) as writer:
        for sample in collection.samples():
            shape = collection.shape(sample)
            cloud = sample_cloud(shape, config.uniform, config.farthest, config.pool, task.rng(sample.key))
            moved = normalization(shape, config.normalize)
            writer.write(sample.key, _members(cloud, moved, config))
            task.progress(writer.samples, total)
    return Outcome(samples=writer.samples, summary={"split": task.shard.params["split"]})


def _members(cloud: SurfacePoints, moved: Normalization, config: PointsConfig) -> dict[str, bytes]:
    described = {
        "farthest": config.farthest,
        "uniform": config.uniform,
        "centre": list(moved.centre),
        "scale": moved.scale,
    }
    points = (cloud.points - moved.centre) * moved.scale
    return {
        "json": json_bytes(described),
        "points.npy": array_bytes(points.astype(np.float32)),
        "normals.npy": array_bytes(cloud.normals.astype(np.float32)),
        "labels.npy": array_bytes(cloud.labels),
        "instances.npy": array_bytes(cloud.instances),
    }


def estimate_bytes(plan: Plan) -> int:
    """Bytes of all clouds: 28 a point, and the tar's headers and padding."""
    config = plan.config.section(PointsConfig)
    samples = sum(int(shard.params["samples"]) for shard in collection_shards(plan))
    return samples * (28 * (config.uniform + config.farthest) + 6144)


STAGE = Stage(
    name="points",
    module=__name__,
    config=PointsConfig,
    inputs=("exemplars", *PRODUCERS),
    plan=plan,
    run_shard=run_shard,
    estimate_bytes=estimate_bytes,
)
