"""A layout: the parts of an exemplar while rows are made longer or shorter, each part with a surface of its own.

A layout knows which parts are translates of each other. Contacts are those of the exemplar, carried along.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from stages.shape.arrays import FloatArray, IntArray, TypeArray
from stages.shape.exemplar_looks import with_looks
from stages.shape.geometry.pose import transform_points
from stages.shape.kit import Assembly, Exemplar, Kit, PartMesh
from stages.shape.shape import Shape

MAX_ROTATION_DIFFERENCE = 1e-3
"""Largest difference of two entries of rotations that count as equal."""
VERTEX_REACH = 4.0
"""Vertices that a step misses by up to this many contact tolerances are at that step."""
MATE_TOLERANCES = 2.0
"""Parts that a step misses by up to this many pose tolerances are at that step."""


@dataclass(frozen=True, eq=False)
class LengthenedMesh(PartMesh):
    """The surface of a part that spans a row whose length has changed.

    of: the surface in the kit
    """

    of: PartMesh

    @property
    def label(self) -> str:
        return self.of.label


@dataclass(frozen=True, eq=False)
class Layout:
    """Posed parts with their contacts.

    meshes: surface of each part; copies share theirs
    poses: float64 (n, 4, 4)
    types: type of each part in the kit, int16 (n,)
    classes: parts of one class are translates of each other, int64 (n,)
    origins: the part of the exemplar that each part is or was copied from, int64 (n,)
    edges: contacts as pairs i < j in lexicographic order, int32 (m, 2)
    tolerance: distance up to which ends of parts coincide, in units
    mate_tolerance: largest distance of a part from where a step leads to, in units
    """

    meshes: tuple[PartMesh, ...]
    poses: FloatArray
    types: TypeArray
    classes: np.ndarray
    origins: np.ndarray
    edges: IntArray
    tolerance: float
    mate_tolerance: float

    def __len__(self) -> int:
        return len(self.types)

    @cached_property
    def points(self) -> tuple[FloatArray, ...]:
        """Vertices of each part in the world, float64 (v, 3)."""
        return tuple(transform_points(pose, mesh.vertices) for mesh, pose in zip(self.meshes, self.poses, strict=True))

    @cached_property
    def boxes(self) -> FloatArray:
        """Boxes of the parts, float64 (n, 2, 3)."""
        return np.stack([np.stack([points.min(axis=0), points.max(axis=0)]) for points in self.points])

    @cached_property
    def areas(self) -> FloatArray:
        """Area of each part's surface, float64 (n,)."""
        return np.array([mesh.area for mesh in self.meshes])

    @cached_property
    def anchors(self) -> FloatArray:
        """Centroid of each part's surface, float64 (n, 3); translates of each other have translated anchors."""
        return np.stack(
            [transform_points(pose, mesh.centroid[None])[0] for mesh, pose in zip(self.meshes, self.poses, strict=True)]
        )

    def heights(self, part: int, normal: FloatArray) -> FloatArray:
        """Return the positions of a part's vertices along a direction, float64 (v,)."""
        key = part, normal.tobytes()
        if key not in self._heights:
            self._heights[key] = self.points[part] @ normal
        return self._heights[key]

    @cached_property
    def _heights(self) -> dict[tuple[int, bytes], FloatArray]:
        return {}

    def vertex_mates(self, part: int, shift: FloatArray) -> np.ndarray:
        """Return the vertex of a part that lies at `shift` from each of its vertices, or -1, int64 (v,)."""
        from scipy.spatial import cKDTree

        key = part, shift.tobytes()
        if key not in self._vertex_mates:
            if part not in self._trees:
                self._trees[part] = cKDTree(self.points[part])
            reach = VERTEX_REACH * self.tolerance
            gaps, nearest = self._trees[part].query(self.points[part] + shift, distance_upper_bound=reach)
            self._vertex_mates[key] = np.where(np.isfinite(gaps), nearest, -1)
        return self._vertex_mates[key]

    @cached_property
    def _vertex_mates(self) -> dict[tuple[int, bytes], np.ndarray]:
        return {}

    @cached_property
    def _trees(self) -> dict[int, Any]:
        return {}

    @cached_property
    def contact_keys(self) -> np.ndarray:
        """A number of each contact, seen from both parts, int64 (2 m,): `part * len(layout) + other`."""
        edges = self.edges.astype(np.int64)
        return np.concatenate([edges[:, 0] * len(self) + edges[:, 1], edges[:, 1] * len(self) + edges[:, 0]])

    @cached_property
    def neighbours(self) -> tuple[np.ndarray, ...]:
        """Parts in contact with each part, int64 (k,) ascending."""
        both = np.sort(self.contact_keys)
        starts = np.searchsorted(both, np.arange(len(self) + 1) * len(self))
        return tuple(both[start:end] % len(self) for start, end in pairwise(starts.tolist()))

    @property
    def extent(self) -> FloatArray:
        """Sides of the box around all parts, float64 (3,)."""
        sides: FloatArray = self.boxes[:, 1].max(axis=0) - self.boxes[:, 0].min(axis=0)
        return sides

    def spans(self, normal: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the lowest and the highest position of each part along a direction, float64 (n,) each."""
        axes = np.flatnonzero(normal)
        if len(axes) == 1 and normal[axes[0]] == 1.0:
            return self.boxes[:, 0, axes[0]], self.boxes[:, 1, axes[0]]
        along = [self.heights(part, normal) for part in range(len(self))]
        return np.array([values.min() for values in along]), np.array([values.max() for values in along])

    def mates(self, shift: FloatArray) -> np.ndarray:
        """Return for each part the part of its class that lies at `shift` (3,) from it, or -1, int64 (n,)."""
        key = shift.tobytes()
        if key not in self._mates:
            distances, nearest = self._anchor_tree.query(self._keyed(self.anchors + shift))
            self._mates[key] = np.where(distances <= self.mate_tolerance, nearest, -1)
        return self._mates[key]

    @cached_property
    def _mates(self) -> dict[bytes, np.ndarray]:
        return {}

    @cached_property
    def _anchor_tree(self) -> Any:
        from scipy.spatial import cKDTree

        return cKDTree(self._keyed(self.anchors))

    def _keyed(self, positions: FloatArray) -> FloatArray:
        """Return positions (n, 4) in which parts of two classes are far apart."""
        return np.column_stack([positions, self.classes * (4.0 * self.mate_tolerance)])

    @cached_property
    def key(self) -> bytes:
        """What two layouts have in common if they look the same up to a translation."""
        low = self.boxes[:, 0].min(axis=0)
        step = 4.0 * self.mate_tolerance
        rows = np.column_stack([self.types, np.rint((self.boxes - low).reshape(-1, 6) / step)]).astype(np.int64)
        return rows[np.lexsort(rows.T)].tobytes()

    def pieces(self) -> np.ndarray:
        """Return the number of the connected piece of each part, int64 (n,)."""
        from scipy.sparse import coo_matrix
        from scipy.sparse.csgraph import connected_components

        i, j = self.edges[:, 0], self.edges[:, 1]
        near = coo_matrix((np.ones(len(i), dtype=np.int8), (i, j)), shape=(len(self), len(self)))
        numbers: np.ndarray = connected_components(near, directed=False)[1].astype(np.int64)
        return numbers

    def assembly(self) -> Assembly:
        """Return the parts as an assembly of the kit's types; spanning parts have the types that they had."""
        return Assembly(self.types, self.poses, self.edges)

    def shape(self, kit: Kit) -> Shape:
        """Return the layout as a shape in which each part has its surface."""
        counts: dict[str, int] = {}
        names = []
        for mesh in self.meshes:
            name = mesh.of.name if isinstance(mesh, LengthenedMesh) else mesh.name
            names.append(f"{name}.{counts.get(name, 0):03d}")
            counts[name] = counts.get(name, 0) + 1
        numbers: dict[int, int] = {}
        kinds = [numbers.setdefault(id(mesh), len(numbers)) for mesh in self.meshes]
        meshes = {id(mesh): mesh for mesh in self.meshes}
        assembly = Assembly(np.array(kinds, dtype=np.int16), self.poses, self.edges)
        return Shape(tuple(meshes.values()), assembly, kit.up, kit.labels, tuple(names), (), kit.one_surface, kit.unit)


def layout_of(kit: Kit, exemplar: Exemplar) -> Layout:
    """Return the layout of an exemplar, hubs among its parts, with contacts of all kinds."""
    from stages.shape.geometry.contact import ContactTest

    whole = exemplar.whole
    if not len(exemplar.removed_hubs) and len(kit.contact_kinds) == 3:
        return _layout(kit, whole)
    edges = ContactTest(kit.types, kit.contact_tolerance).contacts(whole.types, whole.poses)
    return _layout(kit, replace(whole, edges=edges))


def graph_layout(kit: Kit, exemplar: Exemplar) -> Layout:
    """Return the layout of an exemplar as a search sees it: without hubs that were removed, and with the contacts that
    count.
    """
    return _layout(kit, exemplar.assembly)


def _layout(kit: Kit, assembly: Assembly) -> Layout:
    meshes, looked = with_looks(kit, assembly)
    return Layout(
        tuple(meshes[kind] for kind in looked.types.tolist()),
        assembly.poses,
        assembly.types,
        _classes(kit, assembly),
        np.arange(len(assembly)),
        assembly.edges,
        kit.contact_tolerance,
        MATE_TOLERANCES * max(kit.contact_tolerance, kit.pose_tolerance),
    )


def _classes(kit: Kit, whole: Assembly) -> np.ndarray:
    """Return the class of each part: equal type and equal rotation up to symmetries of the type."""
    known: list[tuple[int, FloatArray]] = []
    classes = []
    for kind, pose in zip(whole.types.tolist(), whole.poses, strict=True):
        turned = pose[:3, :3] @ kit.types[kind].symmetries[:, :3, :3]
        equal = (
            number
            for number, (other, rotation) in enumerate(known)
            if other == kind and (np.abs(turned - rotation).max(axis=(1, 2)) <= MAX_ROTATION_DIFFERENCE).any()
        )
        number = next(equal, len(known))
        if number == len(known):
            known.append((kind, pose[:3, :3]))
        classes.append(number)
    return np.array(classes, dtype=np.int64)


def with_translates(layout: Layout, parts: np.ndarray, poses: FloatArray, step: FloatArray, times: int) -> Layout:
    """Return a layout with `times` copies of some parts after its own, each one step further, without their contacts.

    parts: int64 (k,)
    poses: from where the copies are moved, float64 (k, 4, 4)
    step: float64 (3,)
    """
    kept = np.concatenate([np.arange(len(layout)), np.tile(parts, times)])
    copies = np.tile(poses, (times, 1, 1))
    copies[:, :3, 3] += np.repeat(np.arange(1, times + 1), len(parts))[:, None] * step
    return replace(
        layout,
        meshes=tuple(layout.meshes[part] for part in kept.tolist()),
        poses=np.concatenate([layout.poses, copies]),
        types=layout.types[kept],
        classes=layout.classes[kept],
        origins=layout.origins[kept],
    )


def sorted_edges(pairs: Sequence[tuple[int, int]] | np.ndarray) -> IntArray:
    """Return distinct pairs i < j in lexicographic order, int32 (m, 2)."""
    edges = np.sort(np.array(pairs, dtype=np.int64).reshape(-1, 2), axis=1)
    return np.unique(edges, axis=0).astype(np.int32)


def with_classes(layout: Layout, keys: Sequence[tuple[int, ...]]) -> Layout:
    """Return the layout with classes numbered by keys, in order of appearance."""
    numbers: dict[tuple[int, ...], int] = {}
    return replace(layout, classes=np.array([numbers.setdefault(key, len(numbers)) for key in keys], dtype=np.int64))
