"""Partial scans: points of a surface that the cameras of a scan see, with noise along their lines of sight."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.errors import Rejected
from stages.points.area_sampling import SurfacePoints
from stages.points.settings import MAX_NOISE_DEVIATIONS, ScansConfig
from stages.shape.arrays import FloatArray, IntArray, TypeArray
from stages.shape.geometry.ray_casting import RayCaster
from stages.shape.geometry.triangles import unit_normals
from stages.shape.shape import Shape
from stages.shape.views.camera_record import camera_fields, picture_rays
from stages.shape.views.scene import scene_of
from stages.views.cameras import sample_views
from stages.views.settings import ViewsConfig

PICTURE_PIXELS = 512
"""Width and height of the square picture that a camera of a scan sees."""
MAX_ROUNDS = 200
"""Maximum rounds of sending one ray for each point."""


@dataclass(frozen=True)
class Scan:
    """A partial cloud.

    surface: the points, with noise, and normal, class and part of the surface that each was seen on
    camera_of: camera that saw each point, by its place in `cameras`, int16 (n,)
    cameras: as records have them
    noise: standard deviation along the line of sight, in the units of the shape
    """

    surface: SurfacePoints
    camera_of: TypeArray
    cameras: Sequence[Mapping[str, Any]]
    noise: float


def scan_shape(shape: Shape, rays: RayCaster, config: ScansConfig, rng: np.random.Generator) -> Scan:
    """Return one scan of a shape.

    Rays pass through random places of the pictures of random cameras. The first surface on each ray gives a point.
    Raises Rejected if the cameras see next to nothing of the shape.
    """
    from stages.views.placement import bounding_sphere

    sphere = bounding_sphere(scene_of(shape))
    camera_rng, ray_rng, noise_rng = rng.spawn(3)
    pictures = ViewsConfig(cameras=config.cameras, width=PICTURE_PIXELS, height=PICTURE_PIXELS)
    cameras = [
        camera_fields(view, PICTURE_PIXELS, PICTURE_PIXELS)
        for _, view in sample_views(pictures, sphere, lambda _: camera_rng)
    ]
    noise = config.depth_noise * sphere.radius
    points, triangles, camera_of, directions = _first_hits(rays, cameras, config.points, ray_rng)
    along = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    errors = np.clip(noise_rng.standard_normal(config.points), -MAX_NOISE_DEVIATIONS, MAX_NOISE_DEVIATIONS)
    corners, parts = rays.triangles
    part_of = parts[triangles]
    surface = SurfacePoints(
        points + noise * errors[:, None] * along,
        unit_normals(corners[triangles]),
        shape.part_classes[part_of],
        part_of.astype(np.int16),
    )
    return Scan(surface, camera_of.astype(np.int16), cameras, noise)


def _first_hits(
    rays: RayCaster, cameras: Sequence[Mapping[str, Any]], count: int, rng: np.random.Generator
) -> tuple[FloatArray, IntArray, IntArray, FloatArray]:
    """Return points (n, 3), their triangles (n,), the camera of each (n,) and the directions of the rays (n, 3)."""
    found: list[tuple[FloatArray, IntArray, IntArray, FloatArray]] = []
    seen = 0
    for _ in range(MAX_ROUNDS):
        camera_of = rng.integers(len(cameras), size=count).astype(np.int32)
        pixels = PICTURE_PIXELS * rng.random((count, 2))
        origins, directions = np.empty((count, 3)), np.empty((count, 3))
        for index, camera in enumerate(cameras):
            own = camera_of == index
            origins[own], directions[own] = picture_rays(camera, pixels[own])
        distances, triangles = rays.first_hits(origins, directions)
        hit = triangles >= 0
        points = origins[hit] + distances[hit, None] * directions[hit]
        found.append((points, triangles[hit], camera_of[hit], directions[hit]))
        seen += int(hit.sum())
        if seen >= count:
            points, triangles, camera_of, directions = map(np.concatenate, zip(*found, strict=True))
            return points[:count], triangles[:count], camera_of[:count], directions[:count]
    sent = MAX_ROUNDS * count
    raise Rejected("seen by no camera", f"of {sent:,} rays of a scan only {seen:,} meet the shape, not {count:,}")
