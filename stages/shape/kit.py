"""A kit: the part types of one or more exemplar shapes, and the tiling grammar observed in them (strings §3).

A type is a mesh with a label. Where types are told by meaning (substructures §3) several meshes share a label. The
neighbours of a part, the colours of the shape graph and its strings use labels. Contacts, dockings and symmetries use
meshes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np

from stages.shape.appearance import Appearance, Look
from stages.shape.arrays import ByteArray, FloatArray, IntArray, TypeArray
from stages.shape.geometry.triangles import triangle_areas

ContactKind = Literal["point", "line", "face"]

LengthUnit = Literal["metre", "unknown"]
"""Unit of coordinates: metres, or that of files that state none."""

Strictness = Literal[
    "multiset", "count_and_set", "count_and_pairs", "count_and_types", "slot_pairs", "slot_fillings", "slots"
]
"""How close a neighbourhood must be to an observed one.

`stages.shape.graphs.neighbourhoods` defines what each level admits, and `stages.shape.graphs.slots` the last three.
"""

Multiset = tuple[tuple[int, int], ...]
"""Neighbour counts of a part: `(type index, count)` pairs in ascending order of type index."""


@dataclass(frozen=True, eq=False)
class PartMesh:
    """The surface of a part in its own coordinates, compared by identity. Poses move it into the world.

    name: name of the surface; parts of one name share a label
    vertices: float64 (v, 3)
    faces: int32 (f, 3)
    face_colors: sRGB, uint8 (f, 3)
    appearance: materials, texture coordinates and normals, or None for a surface of face colours
    """

    name: str
    vertices: FloatArray
    faces: IntArray
    face_colors: ByteArray
    appearance: Appearance | None = field(default=None, kw_only=True)

    @property
    def label(self) -> str:
        """The label of a part with this surface."""
        return self.name

    @cached_property
    def bounds(self) -> FloatArray:
        """Lowest and highest corner of the box around the part in its own coordinates, float64 (2, 3)."""
        return np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    @cached_property
    def diagonal(self) -> float:
        """Length of the diagonal of `bounds`."""
        return float(np.linalg.norm(self.bounds[1] - self.bounds[0]))

    @cached_property
    def box_tree(self) -> tuple[FloatArray, FloatArray, np.ndarray]:
        """The tree of boxes around the triangles, as of `stages.shape.geometry.mesh_pairs`."""
        from stages.shape.geometry.mesh_pairs import build_tree

        return build_tree(self.vertices, self.faces)

    @cached_property
    def area(self) -> float:
        """Area of the surface, in squared units."""
        return float(triangle_areas(self.vertices[self.faces]).sum())

    @cached_property
    def centroid(self) -> FloatArray:
        """Area-weighted centroid of the surface, float64 (3,); every symmetry of the part preserves it."""
        corners = self.vertices[self.faces]
        areas = triangle_areas(corners)
        centroid: FloatArray = (corners.mean(axis=1) * areas[:, None]).sum(axis=0) / areas.sum()
        return centroid


@dataclass(frozen=True, eq=False)
class PartType(PartMesh):
    """One building block of a kit: a surface that recurs.

    frame: extremal-point coordinate frame (strings §6) in part coordinates, float64 (4, 4)
    symmetries: rigid transforms that map the part onto itself, the identity first, float64 (k, 4, 4)
    meaning: label that it shares with other surfaces; if empty, its name is its label
    other_looks: looks that congruent parts have next to its own
    """

    frame: FloatArray
    symmetries: FloatArray
    meaning: str = ""
    other_looks: tuple[Look, ...] = ()

    @property
    def label(self) -> str:
        return self.meaning or self.name

    @cached_property
    def looked(self) -> tuple[PartType, ...]:
        """The type in each of its looks, its own first; all share their vertices."""
        others = (
            replace(self, face_colors=look.face_colors, appearance=look.appearance, other_looks=())
            for look in self.other_looks
        )
        return (self, *others)


@dataclass(frozen=True, eq=False)
class PartGroup:
    """Parts that the node tree of a model groups below one node.

    parts: type of each part, at least two
    poses: of the parts, in the coordinates of the first one, float64 (k, 4, 4)
    """

    name: str
    parts: tuple[PartType, ...]
    poses: FloatArray


def labels_of(types: Sequence[PartType]) -> tuple[tuple[str, ...], TypeArray]:
    """Return the distinct labels of some types in order of appearance, and the index of each type's label, int16
    (types,).
    """
    labels = tuple(dict.fromkeys(kind.label for kind in types))
    return labels, np.array([labels.index(kind.label) for kind in types], dtype=np.int16)


@dataclass(frozen=True)
class Assembly:
    """Posed parts with their shape graph.

    types: index into the types of a kit, or into the meshes of a shape, int16 (n,)
    poses: rigid, float64 (n, 4, 4)
    edges: contacts as pairs i < j in lexicographic order, int32 (m, 2)
    stretches: symmetric maps applied to each part's mesh in its own coordinates before its pose (substructures §5.2,
        §5.3), float64 (n, 3, 3), or None if no part is stretched
    looks: index of each part's look in `PartType.looked`, int16 (n,), or None if that follows from the exemplars
    """

    types: TypeArray
    poses: FloatArray
    edges: IntArray
    stretches: FloatArray | None = None
    looks: TypeArray | None = None

    def __len__(self) -> int:
        return len(self.types)

    def neighbours(self) -> list[list[int]]:
        """Return the indices of the parts that each part touches, ascending."""
        lists: list[list[int]] = [[] for _ in range(len(self.types))]
        for i, j in self.edges.tolist():
            lists[i].append(j)
            lists[j].append(i)
        return [sorted(neighbours) for neighbours in lists]

    def select(self, parts: np.ndarray) -> Assembly:
        """Return the assembly of the given parts alone, int (k,), ascending."""
        index_of = np.full(len(self), -1, dtype=np.int32)
        index_of[parts] = np.arange(len(parts))
        edges = index_of[self.edges]
        stretches = None if self.stretches is None else self.stretches[parts]
        looks = None if self.looks is None else self.looks[parts]
        return Assembly(self.types[parts], self.poses[parts], edges[(edges >= 0).all(axis=1)], stretches, looks)

    @property
    def placements(self) -> FloatArray:
        """Transform of each part's unstretched mesh into the world, float64 (n, 4, 4): its pose after its stretch."""
        if self.stretches is None:
            return self.poses
        placed = self.poses.copy()
        placed[:, :3, :3] = self.poses[:, :3, :3] @ self.stretches
        return placed

    def multiset(self, neighbours: list[int]) -> Multiset:
        """Return the multiset of the types of the parts `neighbours`."""
        types, counts = np.unique(self.types[neighbours], return_counts=True)
        return tuple(zip(types.tolist(), counts.tolist(), strict=True))


EMPTY_ASSEMBLY = Assembly(np.empty(0, np.int16), np.empty((0, 4, 4)), np.empty((0, 2), np.int32))


@dataclass(frozen=True)
class Docking:
    """One way in which a part of type `b` touches a part of type `a` (a <= b): an edge category.

    pose: representative pose of the part of type `b` in the coordinates of the part of type `a`, float64 (4, 4); poses
        that differ by symmetries of either part are the same docking
    kind: kind of contact
    count: number of observed pairs
    depth: deepest penetration observed, in the kit's units; 0 where the parts only touch
    slack: 0, or for an unobserved docking (`count` 0) that follows from others, how far from `pose` it holds, in the
        kit's units
    """

    a: int
    b: int
    pose: FloatArray
    kind: ContactKind
    count: int
    depth: float
    slack: float = 0.0


@dataclass(frozen=True)
class Grammar:
    """The tiling grammar (strings §3): what was observed around each label, and how pairs of types dock.

    neighbourhoods: for each label, by its index in `Kit.labels`, the observed multisets of neighbour labels with the
        number of parts that had each
    dockings: observed dockings
    nested: for pairs of types (a <= b) the greatest depth of parts within each other without contact
    strictness: which neighbourhoods are allowed in addition to the observed ones
    hubs: types, ascending, that do not count in the neighbourhoods of others and may have any neighbours
    """

    neighbourhoods: Mapping[int, Mapping[Multiset, int]]
    dockings: tuple[Docking, ...]
    nested: Mapping[tuple[int, int], float]
    strictness: Strictness = "multiset"
    hubs: tuple[int, ...] = ()

    @cached_property
    def depths(self) -> Mapping[tuple[int, int], float]:
        """Greatest observed penetration depth for pairs of types (a <= b)."""
        deepest = dict(self.nested)
        for docking in self.dockings:
            deepest[docking.a, docking.b] = max(deepest.get((docking.a, docking.b), 0.0), docking.depth)
        return deepest


@dataclass(frozen=True)
class Exemplar:
    """An input shape.

    assembly: its parts
    part_names: name of each part in its file
    removed_hubs: hub parts that are not in the assembly, without their contacts
    """

    name: str
    assembly: Assembly
    part_names: tuple[str, ...]
    removed_hubs: Assembly = field(default_factory=lambda: EMPTY_ASSEMBLY)

    @property
    def whole(self) -> Assembly:
        """The assembly and its removed hubs, without the contacts of the latter, for pictures."""
        parts, hubs = self.assembly, self.removed_hubs
        types, poses = np.concatenate([parts.types, hubs.types]), np.concatenate([parts.poses, hubs.poses])
        looks = parts.looks
        if len(hubs) and looks is not None and hubs.looks is not None:
            looks = np.concatenate([looks, hubs.looks])
        return Assembly(types, poses, parts.edges, looks=looks)


@dataclass(frozen=True)
class Kit:
    """Part types, exemplars and grammar.

    contact_tolerance: largest distance of two parts in contact, in the kit's units
    pose_tolerance: largest displacement of relative poses that are one docking, in the kit's units
    contact_kinds: kinds of contact that make neighbours
    up: axis that points up in the exemplars' coordinates
    one_surface: whether the parts were cut from one surface; then no line is drawn where they meet
    unit: unit of all coordinates
    groups: groups of parts in the node trees of the exemplars, larger ones first
    """

    name: str
    types: tuple[PartType, ...]
    exemplars: tuple[Exemplar, ...]
    grammar: Grammar
    contact_tolerance: float
    pose_tolerance: float
    contact_kinds: tuple[ContactKind, ...]
    up: Literal["y", "z"]
    one_surface: bool = False
    unit: LengthUnit = "unknown"
    groups: tuple[PartGroup, ...] = ()

    def type_names(self) -> tuple[str, ...]:
        """Return the names of the types, in order."""
        return tuple(part_type.name for part_type in self.types)

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """Distinct labels of the parts; without types by meaning the names of the types."""
        return labels_of(self.types)[0]

    @property
    def by_meaning(self) -> bool:
        """Whether several types share a label."""
        return len(self.labels) < len(self.types)

    @cached_property
    def label_of(self) -> TypeArray:
        """Index of each type's label in `labels`, int16 (types,)."""
        return labels_of(self.types)[1]

    def labelled(self, assembly: Assembly) -> Assembly:
        """Return `assembly` with label indices instead of types: the shape graph of the grammar."""
        return replace(assembly, types=self.label_of[assembly.types])
