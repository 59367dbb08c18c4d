"""Sample points uniformly by area on one mesh, or on all parts of a shape without building its whole mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numba
import numpy as np
import numpy.typing as npt

from stages.shape.arrays import FloatArray, IntArray, TypeArray
from stages.shape.kit import PartMesh
from stages.shape.shape import Shape


@dataclass(frozen=True)
class SurfaceTable:
    """The triangles of one or more meshes, with running areas for sampling.

    vertices: float64 (v, 3)
    faces: rows of `vertices`, int64 (f, 3)
    reach: running sum of the areas inside each mesh, float64 (f,)
    first: where each mesh's triangles start, int64 (m + 1,)
    area: area of each mesh, float64 (m,)
    """

    vertices: FloatArray
    faces: npt.NDArray[np.int64]
    reach: FloatArray
    first: npt.NDArray[np.int64]
    area: FloatArray


@dataclass(frozen=True)
class SurfacePoints:
    """Points on a shape.

    points, normals: float64 (n, 3)
    labels: class of the part, int16 (n,)
    instances: index of the part, int16 (n,)
    """

    points: FloatArray
    normals: FloatArray
    labels: TypeArray
    instances: TypeArray

    def take(self, chosen: npt.NDArray[np.int64]) -> SurfacePoints:
        """Return the points of these indices, in their order."""
        return SurfacePoints(self.points[chosen], self.normals[chosen], self.labels[chosen], self.instances[chosen])

    def replaced(self, places: npt.NDArray[np.int64], others: SurfacePoints) -> SurfacePoints:
        """Return these points with those at `places` (k,) replaced by the k points of `others`."""
        chosen = np.arange(len(self.points))
        chosen[places] = len(self.points) + np.arange(len(places))
        return self.followed_by(others).take(chosen)

    def followed_by(self, other: SurfacePoints) -> SurfacePoints:
        """Return these points, then those of `other`."""
        return SurfacePoints(
            np.concatenate([self.points, other.points]),
            np.concatenate([self.normals, other.normals]),
            np.concatenate([self.labels, other.labels]),
            np.concatenate([self.instances, other.instances]),
        )


def surface_table(meshes: Sequence[tuple[FloatArray, IntArray]]) -> SurfaceTable:
    """Return the table of `meshes`, each `(vertices float64 (v, 3), faces int32 (f, 3))`.

    Raises ValueError if a mesh has no triangle of positive area, or one that is not finite.
    """
    counts = [len(vertices) for vertices, _ in meshes]
    starts = np.cumsum([0, *counts[:-1]])
    vertices = np.ascontiguousarray(np.concatenate([points for points, _ in meshes]), dtype=np.float64)
    faces = np.concatenate(
        [corners.astype(np.int64) + start for (_, corners), start in zip(meshes, starts, strict=True)]
    )
    first = np.cumsum([0, *(len(corners) for _, corners in meshes)])
    reach = _reach(vertices, faces, first)
    area = np.array([reach[end - 1] if end > begin else 0.0 for begin, end in pairwise(first.tolist())])
    if not (np.isfinite(area) & (area > 0.0)).all():
        raise ValueError("a surface to sample needs a positive, finite area")
    return SurfaceTable(vertices, faces, reach, first, area)


def sample_surface(
    vertices: FloatArray, faces: IntArray, n: int, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray, npt.NDArray[np.int64]]:
    """Return `n` independent points on a mesh, uniform by area; triangles of zero area are never hit.

    vertices: float64 (v, 3)
    faces: int32 (f, 3)

    Returns points float64 (n, 3), unit face normals by the winding float64 (n, 3), and each point's face int64 (n,).
    Raises ValueError if the mesh has no area.
    """
    table = surface_table([(vertices, faces)])
    return _points_of_meshes(table, np.zeros(n, dtype=np.int64), rng)


def sample_shape(shape: Shape, n: int, rng: np.random.Generator) -> SurfacePoints:
    """Return `n` independent points on all parts of `shape`, uniform by area over the parts together.

    Surface inside another part, or where two parts meet, counts like any other.
    """
    part_reach = np.cumsum(mesh_table(shape.meshes).area[shape.assembly.types])
    parts = np.searchsorted(part_reach, rng.random(n) * part_reach[-1], side="right")
    return sample_parts(shape, np.minimum(parts, len(part_reach) - 1), rng)


def sample_parts(shape: Shape, parts: npt.NDArray[np.int64], rng: np.random.Generator) -> SurfacePoints:
    """Return one point on each of the parts `parts` (n,), which may repeat; uniform by area on each of them."""
    table, meshes, poses = mesh_table(shape.meshes), shape.assembly.types, shape.assembly.poses
    points, normals, _ = _points_of_meshes(table, meshes[parts].astype(np.int64), rng)
    rotations = poses[parts, :3, :3]
    points = np.einsum("nij,nj->ni", rotations, points) + poses[parts, :3, 3]
    normals = np.einsum("nij,nj->ni", rotations, normals)
    return SurfacePoints(points, normals, shape.part_classes[parts], parts.astype(np.int16))


@lru_cache(maxsize=16)
def mesh_table(meshes: tuple[PartMesh, ...]) -> SurfaceTable:
    """Return the cached surface table of a shape's meshes, in their order."""
    return surface_table([(mesh.vertices, mesh.faces) for mesh in meshes])


def _points_of_meshes(
    table: SurfaceTable, meshes: npt.NDArray[np.int64], rng: np.random.Generator
) -> tuple[FloatArray, FloatArray, npt.NDArray[np.int64]]:
    """Draw a random point on each of the meshes `meshes` (n,).

    Returns points and normals (n, 3), and faces counted from the mesh's first (n,).
    """
    points, normals = np.empty((len(meshes), 3)), np.empty((len(meshes), 3))
    hit = np.empty(len(meshes), dtype=np.int64)
    draws = rng.random((3, len(meshes)))
    _draw(table.vertices, table.faces, table.reach, table.first, meshes, draws, points, normals, hit)
    return points, normals, hit


@numba.njit(cache=True, inline="always")
def _edges(vertices, face):
    """Return the first and second edge of a triangle, and their cross product."""
    o, p, q = face[0], face[1], face[2]
    ax, ay, az = vertices[p, 0] - vertices[o, 0], vertices[p, 1] - vertices[o, 1], vertices[p, 2] - vertices[o, 2]
    bx, by, bz = vertices[q, 0] - vertices[o, 0], vertices[q, 1] - vertices[o, 1], vertices[q, 2] - vertices[o, 2]
    return (ax, ay, az), (bx, by, bz), (ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)


@numba.njit(cache=True)
def _reach(vertices, faces, first):
    """Return running sums of the triangles' areas, from zero for each mesh."""
    reach = np.empty(len(faces))
    for mesh in range(len(first) - 1):
        total = 0.0
        for face in range(first[mesh], first[mesh + 1]):
            _, _, (x, y, z) = _edges(vertices, faces[face])
            total += 0.5 * (x * x + y * y + z * z) ** 0.5
            reach[face] = total
    return reach


@numba.njit(cache=True)
def _draw(vertices, faces, reach, first, meshes, draws, points, normals, hit):
    """Fill `points`, `normals`, `hit` with the first triangle whose running sum exceeds the draw: never one of zero
    area.
    """
    for i in range(len(meshes)):
        low, high = first[meshes[i]], first[meshes[i] + 1] - 1
        # a draw that rounds up to the whole area belongs to the last triangle that has any
        target = min(draws[0, i] * reach[high], np.nextafter(reach[high], 0.0))
        begin = low
        while low < high:
            middle = (low + high) // 2
            if reach[middle] > target:
                high = middle
            else:
                low = middle + 1
        (ax, ay, az), (bx, by, bz), (x, y, z) = _edges(vertices, faces[low])
        size = (x * x + y * y + z * z) ** 0.5
        normals[i, 0], normals[i, 1], normals[i, 2] = x / size, y / size, z / size
        spread = draws[1, i] ** 0.5
        a, b = spread * (1.0 - draws[2, i]), spread * draws[2, i]
        origin = faces[low, 0]
        points[i, 0] = vertices[origin, 0] + a * ax + b * bx
        points[i, 1] = vertices[origin, 1] + a * ay + b * by
        points[i, 2] = vertices[origin, 2] + a * az + b * bz
        hit[i] = low - begin
