"""Check surfaces, unions, distances and occupancy against each other and against rays and nearest points."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pipeline.paths import DatasetPaths
from stages.shape.arrays import FloatArray
from stages.shape.collection.audit import Audit
from stages.shape.collection.packaged import PackagedSample
from stages.surface.members import OCCUPANCY, SDF_POINTS, SDF_VALUES, UNION_FACES, UNION_INSTANCES, UNION_VERTICES
from stages.surface.stage import flag_fields

LENGTH_TOLERANCE_SHARE = 2e-6
"""Largest error of a distance, as a share of the side of the cube."""
POINTS_COMPARED = 100
"""Of the signed distances of a sample."""
CLEAR_DISTANCE_SHARE = 1e-5
"""Signs of points that are nearer to the surface are not compared: the union is stored in 32 bits."""
VOLUME_TOLERANCE_SHARE = 1e-4
MAX_GRID_ERROR_CELLS = 1.0
"""By which the volume of the grid may differ from that of the union: the area of the surface times this many cells."""


def surface_faults(sample: PackagedSample) -> Iterator[str]:
    """Yield a sentence for each two facts about surfaces that cannot both be true."""
    if "surface" in sample.record:
        yield from _flag_faults(sample)
    if "union" not in sample.record:
        return
    facts = sample.record["union"]
    if UNION_VERTICES in sample.arrays:
        yield from _union_faults(sample)
    if OCCUPANCY in sample.arrays:
        filled = np.unpackbits(sample.arrays[OCCUPANCY], axis=2)
        cell = facts["cube_side"] / len(filled)
        if abs(filled.sum() * cell**3 - facts["volume"]) > MAX_GRID_ERROR_CELLS * cell * facts["area"]:
            yield f"its occupancy fills {filled.sum() * cell**3:.6g}, and its union {facts['volume']}"
    if SDF_POINTS in sample.arrays:
        points, values = sample.arrays[SDF_POINTS], sample.arrays[SDF_VALUES]
        if not (np.isfinite(points).all() and np.isfinite(values).all()):
            yield "its signed distances hold entries that are not finite"
        elif (np.abs(values) > facts["cube_side"] * 4).any():
            yield "its signed distances are longer than its cube"


def _flag_faults(sample: PackagedSample) -> Iterator[str]:
    flags = sample.record["surface"]
    if len(flags["parts"]) != len(sample.record["parts"]):
        yield f"its surface has {len(flags['parts'])} parts, and the record {len(sample.record['parts'])}"
    for name in ("closed", "manifold"):
        if flags[name] != all(part[name] for part in flags["parts"]):
            yield f"its surface says {name}: {flags[name]}, and its parts do not"
    if flags["self_intersecting"] != any(part["self_intersecting"] for part in flags["parts"]):
        yield f"its surface says self_intersecting: {flags['self_intersecting']}, and its parts do not"


def _union_faults(sample: PackagedSample) -> Iterator[str]:
    vertices, faces = sample.arrays[UNION_VERTICES].astype(np.float64), sample.arrays[UNION_FACES].astype(np.int64)
    instances, facts = sample.arrays[UNION_INSTANCES], sample.record["union"]
    if not len(faces) or faces.min() < 0 or faces.max() >= len(vertices):
        yield "its union has faces of vertices that do not exist"
        return
    if len(instances) != len(faces) or instances.min() < 0 or instances.max() >= len(sample.record["parts"]):
        yield "its union has faces of parts that do not exist"
    starts, ends = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    forth, back = np.sort(starts * len(vertices) + ends), np.sort(ends * len(vertices) + starts)
    if not np.array_equal(forth, back):
        yield "its union is not watertight"
    middle = vertices.mean(axis=0)
    a, b, c = (vertices[faces[:, corner]] - middle for corner in range(3))
    volume = np.einsum("fi,fi->", a, np.cross(b, c)) / 6
    if abs(volume - facts["volume"]) > VOLUME_TOLERANCE_SHARE * max(facts["volume"], 1e-3 * facts["cube_side"] ** 3):
        yield f"its union encloses {volume:.6g}, and its json says {facts['volume']}"


def recheck_surface(sample: PackagedSample, _: DatasetPaths) -> Iterator[str]:
    """Yield facts about surfaces that differ when derived again, and distances that nearest points contradict."""
    if "surface" in sample.record and flag_fields(sample.shape) != sample.record["surface"]:
        yield "its surface is not as its parts are"
    if SDF_POINTS in sample.arrays:
        yield from _distance_faults(sample, sample.arrays[SDF_POINTS].astype(np.float64), sample.arrays[SDF_VALUES])


def _distance_faults(sample: PackagedSample, points: FloatArray, values: np.ndarray) -> Iterator[str]:
    """Compare some with the nearest points of all parts: outside, these are on the union; inside, none is farther."""
    tolerance = LENGTH_TOLERANCE_SHARE * sample.record["union"]["cube_side"]
    corners = sample.rays.triangles[0]
    chosen = np.linspace(0, len(points) - 1, min(len(points), POINTS_COMPARED)).astype(np.int64)
    gaps = np.array([_gap(corners, points[index], abs(float(values[index])) + tolerance) for index in chosen])
    distances = values[chosen].astype(np.float64)
    outside = distances > 0
    if (np.abs(gaps - distances)[outside] > tolerance).any():
        yield "a signed distance outside is not the distance to its surface"
    if (gaps[~outside] > -distances[~outside] + tolerance).any():
        yield "a signed distance inside is shorter than that to its surface"
    if UNION_VERTICES in sample.arrays and len(points):
        yield from _sign_faults(sample, points, values)


def _gap(corners: FloatArray, point: FloatArray, farthest: float) -> float:
    """Return the distance of a point to the nearest triangle (n, 3, 3), by trimesh; infinite beyond `farthest`."""
    from trimesh.triangles import closest_point

    low, high = corners.min(axis=1), corners.max(axis=1)
    apart = np.maximum(np.maximum(low - point, point - high), 0)
    near = corners[(apart**2).sum(axis=1) <= farthest**2]
    if not len(near):
        return float("inf")
    with np.errstate(divide="ignore", invalid="ignore"):
        closest = closest_point(near, np.repeat(point[None], len(near), axis=0))
    return float(np.nanmin(np.linalg.norm(closest - point, axis=1)))


def _sign_faults(sample: PackagedSample, points: FloatArray, values: np.ndarray) -> Iterator[str]:
    """Compare signs with the solid angle of the stored union, which is all around a point inside."""
    corners = sample.arrays[UNION_VERTICES].astype(np.float64)[sample.arrays[UNION_FACES]]
    clear = np.flatnonzero(np.abs(values) > CLEAR_DISTANCE_SHARE * sample.record["union"]["cube_side"])
    for index in clear[:: max(1, len(clear) // POINTS_COMPARED)].tolist():
        if (_solid_angle(corners - points[index]) > 2 * np.pi) != (values[index] < 0):
            yield f"the sign of signed distance {index} is not that of its union"
            return


def _solid_angle(corners: FloatArray) -> float:
    """Return the signed solid angle of triangles (n, 3, 3) seen from the origin, up to 4 pi."""
    units = corners / np.linalg.norm(corners, axis=2, keepdims=True)
    a, b, c = units[:, 0], units[:, 1], units[:, 2]
    across = np.einsum("ni,ni->n", a, np.cross(b, c))
    along = 1 + np.einsum("ni,ni->n", a, b) + np.einsum("ni,ni->n", b, c) + np.einsum("ni,ni->n", c, a)
    return float(2 * np.arctan2(across, along).sum())


AUDIT = Audit(faults=surface_faults, recheck=recheck_surface)
