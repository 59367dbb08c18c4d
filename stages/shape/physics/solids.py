"""Parts as bodies: volume, area, centroid and, for a cuboid, its box."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from stages.shape.arrays import BoolArray, FloatArray, IntArray
from stages.shape.geometry.polygons import convex_hull
from stages.shape.geometry.triangles import triangle_areas
from stages.shape.kit import Assembly, PartMesh
from stages.shape.physics.boxes import box_corners, recognise_boxes


class MeshSolids:
    """Properties of each mesh in its own coordinates.

    closed: whether the mesh has an inside, bool (k,): every edge is used equally often in both directions, and the
        volume is not negative
    volumes, areas: float64 (k,); the volume of an open mesh is 0
    centroids: of the volume of a closed mesh, else of the surface, float64 (k, 3)
    boxes: whether the mesh is a box, bool (k,)
    centres, axes, halves: the boxes (`stages.shape.physics.boxes`)
    """

    def __init__(self, meshes: Sequence[PartMesh]) -> None:
        count = len(meshes)
        self.closed: BoolArray = np.ones(count, dtype=bool)
        self.volumes, self.areas = np.zeros(count), np.zeros(count)
        self.centroids = np.zeros((count, 3))
        self.boxes: BoolArray = np.zeros(count, dtype=bool)
        self.centres, self.axes, self.halves = np.zeros((count, 3)), np.zeros((count, 3, 3)), np.zeros((count, 3))
        self._boxes([index for index, mesh in enumerate(meshes) if mesh.vertices.shape == (8, 3)], meshes)
        for index in np.flatnonzero(~self.boxes).tolist():
            self._measure(index, meshes[index])

    def _boxes(self, eights: list[int], meshes: Sequence[PartMesh]) -> None:
        eights = [index for index in eights if len(meshes[index].faces) == 12]
        if not eights:
            return
        is_box, centres, axes, halves = recognise_boxes(np.stack([meshes[index].vertices for index in eights]))
        faces = np.stack([meshes[index].faces for index in eights])
        corners = np.stack([meshes[index].vertices for index in eights])[np.arange(len(eights))[:, None, None], faces]
        sides = 8 * (halves * np.roll(halves, 1, axis=1)).sum(axis=1)
        # Twelve triangles with the area of the six sides are the sides: none is missing or repeated.
        is_box &= np.abs(triangle_areas(corners).sum(axis=1) - sides) <= 1e-4 * sides
        for index, row in zip(eights, range(len(eights)), strict=True):
            if is_box[row]:
                self.boxes[index] = True
                self.centres[index], self.axes[index], self.halves[index] = centres[row], axes[row], halves[row]
                self.centroids[index] = centres[row]
                self.volumes[index], self.areas[index] = 8 * halves[row].prod(), sides[row]

    def _measure(self, index: int, mesh: PartMesh) -> None:
        corners = mesh.vertices[mesh.faces]
        origin = mesh.vertices.mean(axis=0)
        a, b, c = (corners[:, k] - origin for k in range(3))
        cones = np.einsum("fc,fc->f", a, np.cross(b, c)) / 6
        self.areas[index] = triangle_areas(corners).sum()
        if _has_inside(mesh.faces) and cones.sum() > 1e-9 * mesh.diagonal**3:
            self.volumes[index] = cones.sum()
            self.centroids[index] = origin + ((a + b + c) / 4 * cones[:, None]).sum(axis=0) / cones.sum()
        else:
            self.closed[index] = False
            self.centroids[index] = mesh.centroid


def _breadth(points: Sequence[FloatArray]) -> float:
    """Return the greatest distance of two of the points seen from above."""
    flat = np.concatenate(points)[:, :2]
    hull = flat[convex_hull(flat)]
    return float(np.linalg.norm(hull[:, None] - hull[None], axis=2).max())


def _has_inside(faces: IntArray) -> bool:
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)
    size = int(faces.max()) + 1
    forth, back = np.sort(edges[:, 0] * size + edges[:, 1]), np.sort(edges[:, 1] * size + edges[:, 0])
    return bool(np.array_equal(forth, back))


@dataclass(frozen=True)
class PlacedParts:
    """The parts of one assembly as bodies in a world whose third axis points up, with the ground at height 0.

    types: mesh of each part
    poses: float64 (n, 4, 4)
    spans: axis-aligned boxes, float64 (n, 2, 3)
    points: vertices of each part, float64 (v, 3)
    diagonal: of the height and the greatest breadth, which no turn about the vertical changes
    weights: sum to 1, float64 (n,)
    weighed: by volume, or by area if a part is open
    centroids: float64 (n, 3)
    boxes: whether each part is a box, bool (n,)
    centres, axes, halves: the boxes
    """

    types: np.ndarray
    poses: FloatArray
    spans: FloatArray
    points: tuple[FloatArray, ...]
    diagonal: float
    weights: FloatArray
    weighed: Literal["volume", "area"]
    centroids: FloatArray
    boxes: BoolArray
    centres: FloatArray
    axes: FloatArray
    halves: FloatArray

    @classmethod
    def of(
        cls, meshes: Sequence[PartMesh], solids: MeshSolids, assembly: Assembly, up: Literal["y", "z"]
    ) -> PlacedParts:
        """Return the bodies of `assembly`. Raises ValueError for a shape without parts or without extent."""
        types = assembly.types.astype(np.int64)
        if not len(types):
            raise ValueError("a shape without parts has no statics")
        # y up: x, y, z become x, -z, y, a rotation.
        rotation = np.eye(3) if up == "z" else np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
        poses = assembly.poses.copy()
        poses[:, :3, :3] = rotation @ assembly.poses[:, :3, :3]
        poses[:, :3, 3] = assembly.poses[:, :3, 3] @ rotation.T
        rotations = poses[:, :3, :3]
        boxes = solids.boxes[types]
        centres = np.einsum("nij,nj->ni", rotations, solids.centres[types]) + poses[:, :3, 3]
        axes = np.einsum("nij,nkj->nki", rotations, solids.axes[types])
        halves = solids.halves[types]
        corners = box_corners(centres, axes, halves)
        points = [
            corners[part] if boxes[part] else meshes[types[part]].vertices @ rotations[part].T + poses[part, :3, 3]
            for part in range(len(types))
        ]
        spans = np.array([[part.min(axis=0), part.max(axis=0)] for part in points])
        low, high = spans[:, 0].min(axis=0), spans[:, 1].max(axis=0)
        if not np.isfinite(spans).all():
            part = int(np.argmin(np.isfinite(spans).all(axis=(1, 2))))
            raise ValueError(f"part {part} stands nowhere: its vertices or its pose hold no finite numbers")
        diagonal = float(np.hypot(high[2] - low[2], _breadth(points)))
        if not diagonal > 0:
            raise ValueError("a shape without extent has no statics")
        drop = np.array([0.0, 0.0, low[2]])
        poses[:, :3, 3] -= drop
        closed = bool(solids.closed[types].all())
        amounts = solids.volumes[types] if closed else solids.areas[types]
        if not amounts.sum() > 0:
            raise ValueError("a shape without volume and area has no weight")
        centroids = np.einsum("nij,nj->ni", rotations, solids.centroids[types]) + poses[:, :3, 3]
        return cls(
            types=types,
            poses=poses,
            spans=spans - drop,
            points=tuple(part - drop for part in points),
            diagonal=diagonal,
            weights=amounts / amounts.sum(),
            weighed="volume" if closed else "area",
            centroids=centroids,
            boxes=boxes,
            centres=centres - drop,
            axes=axes,
            halves=halves,
        )

    def __len__(self) -> int:
        return len(self.types)
