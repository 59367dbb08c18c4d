"""Stage `points`: each sample of the collection becomes a labelled point cloud."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.errors import Rejected
from pipeline.shards import array_bytes, json_bytes
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.points.members import SCAN, cloud_number
from stages.points.settings import PointsConfig, ScansConfig
from stages.shape.collection.collection import Collection, add_members
from stages.shape.collection.shards import PRODUCERS, collection_shards, sample_count
from stages.shape.sample import Sample
from stages.shape.shape import Shape

if TYPE_CHECKING:
    from stages.points.area_sampling import SurfacePoints
    from stages.points.cloud import Normalization


def plan(plan: Plan) -> list[Shard]:
    """Plan one shard for each shard of the collection, unless points are turned off."""
    return collection_shards(plan) if plan.config.section(PointsConfig).enabled else []


def run_shard(task: Task) -> Outcome:
    """Make the members of each sample that `members.py` declares."""
    config = task.config.section(PointsConfig)

    def cloud_members(collection: Collection, sample: Sample) -> Mapping[str, bytes]:
        return point_members(collection.shape(sample), config, lambda *place: task.rng(sample.key, *place))

    return Outcome(add_members(task, cloud_members), {"split": task.shard.params["split"]})


def point_members(shape: Shape, config: PointsConfig, rng_of: Callable[..., np.random.Generator]) -> dict[str, bytes]:
    """Return the members of one sample.

    rng_of: returns the random stream of the first cloud without arguments, and those of the others by kind and number

    Raises Rejected if too little of the shape is seen, where only what is seen counts.
    """
    from stages.points.cloud import min_points_of_parts, normalization, sample_cloud

    moved = normalization(shape, config.normalize)
    described: dict[str, Any] = {
        "farthest": config.farthest,
        "uniform": config.uniform,
        "surface": config.surface,
        "centre": list(moved.centre),
        "scale": moved.scale,
    }
    minimum = min_points_of_parts(shape, config.uniform, config.min_per_part)
    if config.min_per_part:
        described["min_per_part"] = minimum
    if config.clouds > 1:
        described["clouds"] = config.clouds
    members: dict[str, bytes] = {}
    for number in range(config.clouds):
        rng = rng_of("cloud", number) if number else rng_of()
        try:
            cloud = sample_cloud(shape, config.uniform, config.farthest, config.pool, config.surface, rng, minimum)
        except ValueError as error:
            raise Rejected("too little seen from outside", str(error)) from error
        members |= _cloud_files(cloud, moved, "", cloud_number(number))
    fields: dict[str, Any] = {"points": described}
    if config.scans is not None:
        scans, files = _scan_files(shape, config.scans, moved, rng_of)
        fields, members = {**fields, "scans": scans}, members | files
    return {"json": json_bytes(fields), **members}


def _scan_files(
    shape: Shape, config: ScansConfig, moved: Normalization, rng_of: Callable[..., np.random.Generator]
) -> tuple[list[dict[str, Any]], dict[str, bytes]]:
    """Return the record of each scan, and their files."""
    from stages.points.scans import scan_shape
    from stages.shape.geometry.ray_casting import RayCaster

    rays = RayCaster(shape)
    described: list[dict[str, Any]] = []
    files: dict[str, bytes] = {}
    for number in range(config.count):
        scan = scan_shape(shape, rays, config, rng_of("scan", number))
        described.append({"depth_noise": scan.noise, "cameras": scan.cameras})
        files |= _cloud_files(scan.surface, moved, SCAN, str(number))
        files[f"{SCAN}cameras{number}.npy"] = array_bytes(scan.camera_of)
    return described, files


def _cloud_files(cloud: SurfacePoints, moved: Normalization, prefix: str, number: str) -> dict[str, bytes]:
    return {
        f"{prefix}points{number}.npy": array_bytes(((cloud.points - moved.centre) * moved.scale).astype(np.float32)),
        f"{prefix}normals{number}.npy": array_bytes(cloud.normals.astype(np.float32)),
        f"{prefix}labels{number}.npy": array_bytes(cloud.labels),
        f"{prefix}instances{number}.npy": array_bytes(cloud.instances),
    }


def estimate_bytes(plan: Plan) -> int:
    """Return the bytes of all clouds: 28 a point, 30 of scans, and the tar's headers and padding."""
    config = plan.config.section(PointsConfig)
    if not config.enabled:
        return 0
    clouds = config.clouds * (28 * (config.uniform + config.farthest) + 6144)
    scans = config.scans
    return sample_count(plan) * (clouds + (scans.count * (30 * scans.points + 8192) if scans else 0))


STAGE = Stage(
    name="points",
    module=__name__,
    config=PointsConfig,
    inputs=(PRODUCERS,),
    plan=plan,
    run_shard=run_shard,
    estimate_bytes=estimate_bytes,
)
