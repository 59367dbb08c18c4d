"""The watertight union of the parts of a shape, by manifold3d."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from pipeline.errors import Rejected
from stages.shape.arrays import FloatArray, IntArray, TypeArray
from stages.shape.geometry.connected_faces import connected_faces
from stages.shape.geometry.pose import transform_points
from stages.shape.kit import PartMesh
from stages.shape.shape import Shape
from stages.surface.checks import surface_flags, welded


@dataclass(frozen=True)
class UnionMesh:
    """The surface of all parts as one solid: closed, oriented outwards, without what lies inside another part.

    vertices: float64 (v, 3), in the coordinates of the shape
    faces: int32 (f, 3)
    instances: index of the part that each face comes from, int16 (f,)
    volume, area: of the solid and its surface
    components: number of separate surfaces
    """

    vertices: FloatArray
    faces: IntArray
    instances: TypeArray
    volume: float
    area: float
    components: int


@dataclass(frozen=True)
class SolidSurface:
    """A closed surface that bounds a solid, in the coordinates of the shape.

    part: index of the part that it belongs to
    vertices: float64 (v, 3)
    faces: oriented outwards, int32 (f, 3)
    """

    part: int
    vertices: FloatArray
    faces: IntArray


def solids_of(shape: Shape) -> list[SolidSurface]:
    """Return the solids that the parts of a shape are: one for each part, or for each of its closed surfaces.

    Raises Rejected for a part whose inside is not beyond doubt: an open one, one with a surface that intersects itself,
    or one that faces inwards.
    """
    surfaces = {kind: _closed_surfaces(shape.meshes[kind]) for kind in sorted(set(shape.assembly.types.tolist()))}
    solids = []
    for part, (kind, pose) in enumerate(zip(shape.assembly.types.tolist(), shape.assembly.poses, strict=True)):
        found = surfaces[kind]
        if isinstance(found, str):
            raise Rejected(found, shape.part_names[part])
        solids += [SolidSurface(part, transform_points(pose, vertices), faces) for vertices, faces in found]
    return solids


@lru_cache(maxsize=512)
def _closed_surfaces(mesh: PartMesh) -> tuple[tuple[FloatArray, IntArray], ...] | str:
    """Return the surfaces of a part, each the border of a solid, or in words why it has no clear inside.

    A part that intersects itself may be several solids in one mesh. Then none of these may intersect itself.
    """
    flags = surface_flags(mesh)
    if not flags.closed:
        return "open part"
    pieces = [welded(mesh)]
    if not flags.manifold or flags.self_intersecting:
        pieces = list(_components(mesh))
        for vertices, faces in pieces:
            own = surface_flags(replace(mesh, vertices=vertices, faces=faces))
            if not own.closed or not own.manifold or own.self_intersecting:
                return "part without a clear inside"
    for vertices, faces in pieces:
        corners = vertices[faces]
        if not np.einsum("fi,fi->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) > 0:
            return "part inside out"
    return tuple(pieces)


def _components(mesh: PartMesh) -> Iterator[tuple[FloatArray, IntArray]]:
    """Yield the surfaces that a mesh of several solids was made of."""
    vertices, faces = welded(mesh)
    component = connected_faces(vertices, faces, np.zeros(len(faces), dtype=np.int64))
    for number in range(int(component.max()) + 1):
        used, renamed = np.unique(faces[component == number], return_inverse=True)
        yield vertices[used], renamed.reshape(-1, 3).astype(np.int32)


def union_mesh(solids: Sequence[SolidSurface]) -> UnionMesh:
    """Return the union of solids. Raises Rejected where manifold3d finds none."""
    from manifold3d import Manifold, Mesh64, OpType

    first = Manifold.reserve_ids(len(solids))
    added = []
    for index, solid in enumerate(solids):
        mesh = Mesh64(
            vert_properties=np.ascontiguousarray(solid.vertices),
            tri_verts=solid.faces.astype(np.uint64),
            run_index=np.array([0, solid.faces.size], dtype=np.uint64),
            run_original_id=np.array([first + index], dtype=np.uint32),
        )
        added.append(Manifold(mesh))
        if added[-1].is_empty():
            raise Rejected("no union", f"part {solid.part}: manifold3d says {added[-1].status().name}")
    union = Manifold.batch_boolean(added, OpType.Add)
    made = union.to_mesh64()
    faces = np.asarray(made.tri_verts, dtype=np.int64)
    if union.is_empty() or not len(faces):
        raise Rejected("no union", f"manifold3d says {union.status().name}")
    runs = np.asarray(made.run_index, dtype=np.int64)
    counts: np.ndarray = (runs[1:] - runs[:-1]) // 3
    owner = np.array([solid.part for solid in solids], dtype=np.int64)
    instances = owner[np.repeat(np.asarray(made.run_original_id, dtype=np.int64) - first, counts)]
    vertices = np.asarray(made.vert_properties, dtype=np.float64)[:, :3]
    order, canonical = _canonical(vertices, faces)
    return UnionMesh(
        vertices=vertices[order],
        faces=canonical[0],
        instances=instances[canonical[1]].astype(np.int16),
        volume=float(union.volume()),
        area=float(union.surface_area()),
        components=len(union.decompose()),
    )


def _canonical(vertices: FloatArray, faces: np.ndarray) -> tuple[np.ndarray, tuple[IntArray, np.ndarray]]:
    """Return an order of vertices and faces that no thread decides: (vertex order, (faces, order of the faces))."""
    order = np.lexsort(vertices.T[::-1])
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    renamed = rank[faces]
    turns = renamed.argmin(axis=1)
    renamed = np.take_along_axis(renamed, (turns[:, None] + np.arange(3)) % 3, axis=1)
    face_order = np.lexsort(renamed.T[::-1])
    return order, (renamed[face_order].astype(np.int32), face_order)
