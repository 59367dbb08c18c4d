"""Scenes: meshes stored once, and the posed instances of them that make a shape."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Literal

import numpy as np

from stages.shape.appearance import Appearance
from stages.shape.arrays import BoolArray, ByteArray, Float32Array, FloatArray, IntArray
from stages.shape.geometry.triangles import unit_normals
from stages.shape.kit import PartMesh
from stages.shape.shape import Shape

if TYPE_CHECKING:
    from stages.shape.views.mesh_look import MeshLook, SurfaceMaps

WELD_DISTANCE_SHARE = 2e-6
"""Vertices closer than this share of half their mesh's longest side count as one vertex."""


@dataclass(frozen=True, eq=False)
class MeshSet:
    """Meshes in one block, compared by identity, so that a renderer keeps its uploads.

    vertices: each mesh around the middle of its box, so that a distant model keeps its digits in single precision,
        float64 (v, 3)
    faces: rows of `vertices`, int32 (f, 3)
    colors: sRGB, uint8 (f, 3)
    vertex_first, face_first: where each mesh begins and ends, int64 (m + 1,)
    centers: the middles, float64 (m, 3)
    looks: of each mesh, or None where it has the colours of its faces alone; empty if none has more
    """

    vertices: FloatArray
    faces: IntArray
    colors: ByteArray
    vertex_first: np.ndarray
    face_first: np.ndarray
    centers: FloatArray
    looks: tuple[Appearance | None, ...] = ()

    @staticmethod
    def of(
        meshes: Sequence[tuple[FloatArray, IntArray, ByteArray]], looks: Sequence[Appearance | None] = ()
    ) -> MeshSet:
        """Return the set of `(vertices (v, 3), faces (f, 3), face colors (f, 3))`, with looks if some have more."""
        middles = [(v.min(axis=0) + v.max(axis=0)) / 2 if len(v) else np.zeros(3) for v, _, _ in meshes]
        vertex_first = np.cumsum([0, *(len(v) for v, _, _ in meshes)])
        face_first = np.cumsum([0, *(len(f) for _, f, _ in meshes)])
        faces = [f + first for (_, f, _), first in zip(meshes, vertex_first, strict=False)]
        return MeshSet(
            vertices=np.concatenate([v - c for (v, _, _), c in zip(meshes, middles, strict=True)]).astype(np.float64),
            faces=np.concatenate(faces).astype(np.int32),
            colors=np.concatenate([c for _, _, c in meshes]).astype(np.uint8),
            vertex_first=vertex_first,
            face_first=face_first,
            centers=np.array(middles, dtype=np.float64).reshape(-1, 3),
            looks=tuple(looks) if any(look is not None for look in looks) else (),
        )

    @cached_property
    def normals(self) -> FloatArray:
        """Unit normal of each face in mesh coordinates, float64 (f, 3); zero for a face without area."""
        return unit_normals(self.vertices[self.faces])

    @cached_property
    def corner_normals(self) -> Float32Array:
        """Unit normal at each corner of each face in mesh coordinates, float32 (f, 3, 3), for smooth shading."""
        from stages.shape.views.corner_normals import corner_normals

        computed = corner_normals(self.vertices, self.faces, self._welded, self.normals)
        for look, first in zip(self.looks, self.face_first.tolist(), strict=False):
            if look is not None and look.normals is not None:
                computed[first : first + len(look)] = look.normals
        return computed

    @cached_property
    def look(self) -> MeshLook | None:
        """Materials and textures of the faces; None if no face has a material."""
        from stages.shape.views.mesh_look import mesh_look

        return mesh_look(self.looks, np.diff(self.face_first).tolist()) if self.looks else None

    @cached_property
    def maps(self) -> SurfaceMaps | None:
        """What materials have besides base colours; None if they have nothing."""
        from stages.shape.views.mesh_look import surface_maps

        return surface_maps(self.looks, np.diff(self.face_first).tolist()) if self.looks else None

    @cached_property
    def frames(self) -> FloatArray:
        """Where texture coordinates grow on each face, to the right and upwards, float64 (f, 2, 3)."""
        from stages.shape.views.mesh_look import face_frames

        uv = np.zeros((len(self.faces), 3, 2), np.float32) if self.look is None else self.look.uv
        return face_frames(self.vertices[self.faces], uv)

    @cached_property
    def _welded(self) -> np.ndarray:
        """The corners of each face, int64 (f, 3), with one number for all at one position."""
        mesh_of = np.repeat(np.arange(len(self.centers)), np.diff(self.vertex_first))
        size = np.zeros(len(self.centers))
        np.maximum.at(size, mesh_of, np.abs(self.vertices).max(axis=1))
        cells = np.rint(self.vertices / np.maximum(size[mesh_of, None] * WELD_DISTANCE_SHARE, np.finfo(float).tiny))
        welded = np.unique(np.column_stack([mesh_of, cells + 0.0]), axis=0, return_inverse=True)[1].ravel()
        return np.asarray(welded[self.faces])

    @cached_property
    def neighbours(self) -> IntArray:
        """The face across each edge (0-1, 1-2, 2-0) of each face, int32 (f, 3); -1 if there is not exactly one.

        Vertices at the same position (within a millionth of the mesh) count as one, so seams of texture or shading are
        not borders.
        """
        corners = self._welded
        starts, ends = corners.ravel(), corners[:, [1, 2, 0]].ravel()
        keys = np.minimum(starts, ends) * (len(self.vertices) + 1) + np.maximum(starts, ends)
        order = np.argsort(keys, kind="stable")
        ordered = keys[order]
        new = np.flatnonzero(np.r_[True, ordered[1:] != ordered[:-1]]) if len(order) else np.empty(0, dtype=np.int64)
        pairs = new[np.diff(np.r_[new, len(order)]) == 2]
        first, second = order[pairs], order[pairs + 1]
        neighbours = np.full(len(keys), -1, dtype=np.int32)
        neighbours[first], neighbours[second] = second // 3, first // 3
        return neighbours.reshape(-1, 3)


@dataclass(frozen=True)
class Scene:
    """Posed instances of meshes.

    mesh_of: mesh of each part, int32 (n,)
    poses: rigid, float64 (n, 4, 4)
    layers: of faces of two parts in one plane, that of the lower layer is seen, int32 (n,)
    up: axis that points up
    one_surface: whether no line is drawn where the surface of one part continues in the next
    """

    meshes: MeshSet
    mesh_of: IntArray
    poses: FloatArray
    layers: IntArray
    up: Literal["y", "z"]
    one_surface: bool = False

    def __len__(self) -> int:
        return len(self.mesh_of)

    @cached_property
    def placed(self) -> FloatArray:
        """Poses that also undo the centering of the meshes, float64 (n, 4, 4)."""
        placed = self.poses.copy()
        placed[:, :3, 3] += np.einsum("nij,nj->ni", self.poses[:, :3, :3], self.meshes.centers[self.mesh_of])
        return placed

    @cached_property
    def triangle_first(self) -> np.ndarray:
        """Number of the first triangle of each part, then the total, int64 (n + 1,)."""
        counts = np.diff(self.meshes.face_first)[self.mesh_of]
        return np.concatenate([[0], np.cumsum(counts)])

    @cached_property
    def triangle_part(self) -> IntArray:
        """The part of each triangle, int32 (t,)."""
        part: IntArray = np.repeat(np.arange(len(self), dtype=np.int32), np.diff(self.triangle_first))
        return part

    @cached_property
    def triangle_face(self) -> IntArray:
        """The face of each triangle in the mesh set, int32 (t,)."""
        shift = self.meshes.face_first[self.mesh_of] - self.triangle_first[:-1]
        face: IntArray = np.arange(self.triangle_first[-1]) + np.repeat(shift, np.diff(self.triangle_first))
        return face.astype(np.int32)

    @cached_property
    def points(self) -> FloatArray:
        """All vertices of all parts in the world, float64 (p, 3), part by part."""
        points = []
        for mesh, pose in zip(self.mesh_of.tolist(), self.placed, strict=True):
            local = self.meshes.vertices[self.meshes.vertex_first[mesh] : self.meshes.vertex_first[mesh + 1]]
            points.append(local @ pose[:3, :3].T + pose[:3, 3])
        return np.concatenate(points) if points else np.empty((0, 3))


def scene_of(shape: Shape) -> Scene:
    """Return the scene of a shape. Scenes of shapes with the same meshes share one mesh set."""
    parts = shape.assembly
    layers = _layers(len(parts), parts.edges)
    types = parts.types.astype(np.int32)
    return Scene(mesh_set(shape.meshes), types, parts.poses, layers, shape.up, shape.one_surface)


def mesh_scene(vertices: FloatArray, faces: IntArray, face_colors: ByteArray, up: Literal["y", "z"]) -> Scene:
    """Return a scene of one part: vertices (v, 3), faces (f, 3), face_colors uint8 (f, 3)."""
    single = np.zeros(1, dtype=np.int32)
    return Scene(MeshSet.of([(vertices, faces, face_colors)]), single, np.eye(4)[None], single, up)


def without_faces(scene: Scene, left_out: BoolArray) -> Scene:
    """Return the scene without the faces of its mesh set that are `left_out`, bool (f,)."""
    meshes = scene.meshes
    kept = []
    for mesh in range(len(meshes.centers)):
        first, last = meshes.vertex_first[mesh], meshes.vertex_first[mesh + 1]
        faces = np.arange(meshes.face_first[mesh], meshes.face_first[mesh + 1])
        faces = faces[~left_out[faces]]
        vertices = meshes.vertices[first:last] + meshes.centers[mesh]
        kept.append((vertices, meshes.faces[faces] - np.int32(first), meshes.colors[faces]))
    return replace(scene, meshes=MeshSet.of(kept))


@lru_cache(maxsize=16)
def mesh_set(meshes: tuple[PartMesh, ...]) -> MeshSet:
    """Return the set of these meshes, the same object for the same meshes."""
    looks = [mesh.appearance for mesh in meshes]
    return MeshSet.of([(mesh.vertices, mesh.faces, mesh.face_colors) for mesh in meshes], looks)


def _layers(parts: int, edges: IntArray) -> IntArray:
    """Return a small number for each part that differs from those of all parts it touches, int32 (parts,)."""
    lower: list[list[int]] = [[] for _ in range(parts)]
    for i, j in edges.tolist():
        lower[max(i, j)].append(min(i, j))
    layers: list[int] = []
    for part in range(parts):
        taken = {layers[other] for other in lower[part]}
        layer = 0
        while layer in taken:
            layer += 1
        layers.append(layer)
    return np.array(layers, dtype=np.int32)
