"""Check that the points of a scan are what its cameras see, within the noise."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from stages.points.members import SCAN
from stages.points.settings import MAX_NOISE_DEVIATIONS
from stages.points.triangle_distances import point_triangle_distances
from stages.shape.arrays import FloatArray, IntArray
from stages.shape.collection.packaged import PackagedSample
from stages.shape.geometry.triangles import unit_normals

MAX_GAP_SHARE = 2e-5
"""Largest distance of a point without noise from the surface, as a share of the shape's size and place."""
MAX_STRAY_SHARE = 0.01
"""Maximum share of points, at silhouettes, whose ray meets something else when it is sent again."""
MIN_NORMAL_COSINE = 1.0 - 1e-3
MAX_SPREAD_ERRORS = 6.0
"""Largest error of the spread of the noise, in standard errors of its estimate."""
MIN_SPREAD_POINTS = 100


def scan_faults(sample: PackagedSample, index: int) -> Iterator[str]:
    """Yield a sentence for each kind of points that no camera of the scan sees, or that have another noise."""
    described, scan = sample.record["points"], sample.record["scans"][index]
    stored = {name: sample.arrays[f"{SCAN}{name}{index}.npy"] for name in ("points", "normals", "labels", "instances")}
    camera_of = sample.arrays[f"{SCAN}cameras{index}.npy"]
    points = stored["points"].astype(np.float64) / described["scale"] + described["centre"]
    instances = stored["instances"].astype(np.int32)
    if not np.isfinite(points).all() or not np.isfinite(stored["normals"]).all():
        return  # other checks report arrays that are not finite
    if instances.min() < 0 or instances.max() >= len(sample.shape):
        yield "its points name parts that do not exist"
        return
    if camera_of.min() < 0 or camera_of.max() >= len(scan["cameras"]):
        yield "its points name cameras that do not exist"
        return
    if (sample.shape.part_classes[instances] != stored["labels"]).any():
        yield "its point labels are not the classes of their parts"
    noise = float(scan["depth_noise"])
    place = max(sample.size, float(np.abs(sample.record["bounds"]).max()))
    near = MAX_NOISE_DEVIATIONS * noise + MAX_GAP_SHARE * place
    off = _far_points(sample, points, instances, near)
    if off:
        yield f"{off} of its {len(points):,} points are farther from their part than the noise allows"
        return
    errors, triangles = _depth_errors(sample, points, scan["cameras"], camera_of)
    corners, parts = sample.rays.triangles
    seen = (np.abs(errors) <= near) & (parts[triangles] == instances)
    if (~seen).sum() > max(1.0, MAX_STRAY_SHARE * len(points)):
        yield f"{(~seen).sum()} of its {len(points):,} points are hidden from their camera"
        return
    cosines = np.einsum("ij,ij->i", stored["normals"].astype(np.float64), unit_normals(corners[triangles]))
    turned = int((seen & (cosines < MIN_NORMAL_COSINE)).sum())
    if turned > max(1.0, MAX_STRAY_SHARE * len(points)):
        yield f"{turned} of its {len(points):,} normals are not those of the surface"
    count = int(seen.sum())
    spread = float(np.sqrt(np.mean(errors[seen] ** 2)))
    slack = MAX_GAP_SHARE * place + MAX_SPREAD_ERRORS * noise / np.sqrt(2 * count)
    if count >= MIN_SPREAD_POINTS and abs(spread - noise) > slack:
        yield f"its noise has a standard deviation of {spread:.4g}, its json says {noise:.4g}"


def _far_points(sample: PackagedSample, points: FloatArray, instances: IntArray, near: float) -> int:
    """Return how many points are more than `near` from the surface of their part."""
    corners, parts = sample.rays.triangles
    nearest, gaps = sample.rays.nearest(points)
    doubtful = np.flatnonzero((parts[nearest] != instances) | (gaps > near))
    far = 0
    for part in np.unique(instances[doubtful]).tolist():
        mine = doubtful[instances[doubtful] == part]
        far += int((point_triangle_distances(points[mine], corners[parts == part]).min(axis=1) > near).sum())
    return far


def _depth_errors(
    sample: PackagedSample, points: FloatArray, cameras: list[dict[str, object]], camera_of: np.ndarray
) -> tuple[FloatArray, IntArray]:
    """Return how far each point lies behind what its camera sees in its direction, float64 (n,), and the triangle seen
    there, int32 (n,).

    From matrices of the record alone: scans are made by another way from pixels to rays.
    """
    starts, directions = np.empty_like(points), np.empty_like(points)
    for index, camera in enumerate(cameras):
        own = camera_of == index
        pose = np.array(camera["world_to_camera"])
        if camera["projection"] == "perspective":
            starts[own] = -pose[:3, :3].T @ pose[:3, 3]
            directions[own] = points[own] - starts[own]
        else:
            directions[own] = pose[2, :3]
            depths = points[own] @ pose[2, :3] + pose[2, 3]
            starts[own] = points[own] - depths[:, None] * pose[2, :3]
    lengths = np.linalg.norm(points - starts, axis=1)
    along = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    distances, triangles = sample.rays.first_hits(starts, along)
    return lengths - distances, triangles
