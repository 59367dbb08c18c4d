"""A kit: the part types of one or more exemplar shapes, and the tiling grammar observed in them (strings §3).

A type is a mesh, and what it is called is its label. Where types are told by meaning (substructures §3) several meshes
share a label: which parts may be neighbours, the shape graph's colours and its strings go by the label; contacts,
dockings and symmetries by the mesh.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np

from stages.shape.arrays import ByteArray, FloatArray, IntArray, TypeArray
from stages.shape.geometry.triangles import triangle_areas

ContactKind = Literal["point", "line", "face"]

Strictness = Literal[
    "multiset", "count_and_set", "count_and_pairs", "count_and_types", "slot_pairs", "slot_fillings", "slots"
]
"""How near to what was observed a neighbourhood must be; `stages.shape.graphs.neighbourhoods`, and of the last three
`stages.shape.graphs.slots`, say what each admits."""

Multiset = tuple[tuple[int, int], ...]
"""Neighbour counts of a part: `(type index, count)` pairs in ascending order of type index."""


@dataclass(frozen=True, eq=False)
class PartMesh:
    """The surface of a part, compared by identity. Its coordinates are its own; poses move them into the world.

    name: what the surface is called; parts of one name have one label.
    vertices: float64 (v, 3); faces: int32 (f, 3); face_colors: uint8 (f, 3) sRGB.
    """

    name: str
    vertices: FloatArray
    faces: IntArray
    face_colors: ByteArray

    @property
    def label(self) -> str:
        """What a part of this surface is called."""
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
    def centroid(self) -> FloatArray:
        """Area-weighted centroid of the surface, float64 (3,): unmoved by every symmetry of the part."""
        corners = self.vertices[self.faces]
        areas = triangle_areas(corners)
        centroid: FloatArray = (corners.mean(axis=1) * areas[:, None]).sum(axis=0) / areas.sum()
        return centroid


@dataclass(frozen=True, eq=False)
class PartType(PartMesh):
    """One building block of a kit: a surface that recurs.

    frame: float64 (4, 4), the extremal-point coordinate frame (strings §6), in part coordinates.
    symmetries: float64 (k, 4, 4), the rigid motions that map the part onto itself, the identity first.
    meaning: the label that it shares with other surfaces, or empty: then its name is its label.
    """

    frame: FloatArray
    symmetries: FloatArray
    meaning: str = ""

    @property
    def label(self) -> str:
        return self.meaning or self.name


def labels_of(types: Sequence[PartType]) -> tuple[tuple[str, ...], TypeArray]:
    """The labels of some types, each once, in the order in which they come, and the place of each type's among them,
    int16 (types,)."""
    labels = tuple(dict.fromkeys(kind.label for kind in types))
    return labels, np.array([labels.index(kind.label) for kind in types], dtype=np.int16)


@dataclass(frozen=True)
class Assembly:
    """Parts put together, with their shape graph.

    types: int16 (n,) indices into the types of a kit, or into the meshes of a shape; poses: float64 (n, 4, 4) rigid;
    edges: int32 (m, 2), contacts as pairs i < j in lexicographic order; stretches: float64 (n, 3, 3), symmetric, by
    which each part's mesh is multiplied in its own coordinates before its pose moves it (substructures §5.2, §5.3), or
    None where all are as they are.
    """

    types: TypeArray
    poses: FloatArray
    edges: IntArray
    stretches: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.types)

    def neighbours(self) -> list[list[int]]:
        """For each part the indices of the parts that it touches, ascending."""
        lists: list[list[int]] = [[] for _ in range(len(self.types))]
        for i, j in self.edges.tolist():
            lists[i].append(j)
            lists[j].append(i)
        return [sorted(neighbours) for neighbours in lists]

    def select(self, parts: np.ndarray) -> Assembly:
        """The assembly of the given parts alone, int (k,), ascending."""
        place = np.full(len(self), -1, dtype=np.int32)
        place[parts] = np.arange(len(parts))
        edges = place[self.edges]
        stretches = None if self.stretches is None else self.stretches[parts]
        return Assembly(self.types[parts], self.poses[parts], edges[(edges >= 0).all(axis=1)], stretches)

    @property
    def placements(self) -> FloatArray:
        """What moves the mesh of each part as it is into the world, float64 (n, 4, 4): its pose, which is rigid, after
        its stretch."""
        if self.stretches is None:
            return self.poses
        placed = self.poses.copy()
        placed[:, :3, :3] = self.poses[:, :3, :3] @ self.stretches
        return placed

    def multiset(self, neighbours: list[int]) -> Multiset:
        """The multiset of the types of the parts `neighbours`."""
        types, counts = np.unique(self.types[neighbours], return_counts=True)
        return tuple(zip(types.tolist(), counts.tolist(), strict=True))


EMPTY_ASSEMBLY = Assembly(np.empty(0, np.int16), np.empty((0, 4, 4)), np.empty((0, 2), np.int32))
"""An assembly without parts."""


@dataclass(frozen=True)
class Docking:
    """One way in which a part of type `b` touches a part of type `a` (a <= b): an edge category.

    pose: float64 (4, 4) of the part of type `b` in the coordinates of the part of type `a`, one representative;
    poses that differ by symmetries of either part are the same docking.
    depth: deepest penetration seen in any pair of this docking, in the kit's units; 0 where they only touch.
    slack: 0, or for a docking that was never seen (`count` 0) but follows from others, as parts of these labels dock
    so: how far from `pose` it holds, in the kit's units.
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
    """The tiling grammar (strings §3): what was seen around each label, and how pairs of types dock.

    neighbourhoods: for each label, by its place in `Kit.labels`, the observed multisets of neighbours' labels with the
    number of parts that had each.
    nested: for pairs of types (a <= b) the greatest depth at which parts lay within each other without contact.
    strictness: which neighbourhoods beside the observed ones are allowed.
    hubs: types, ascending, that stand outside the neighbourhoods of others and may have any themselves.
    """

    neighbourhoods: Mapping[int, Mapping[Multiset, int]]
    dockings: tuple[Docking, ...]
    nested: Mapping[tuple[int, int], float]
    strictness: Strictness = "multiset"
    hubs: tuple[int, ...] = ()

    @cached_property
    def depths(self) -> Mapping[tuple[int, int], float]:
        """For pairs of types (a <= b) how deep parts of them reached into each other in the exemplars at most."""
        deepest = dict(self.nested)
        for docking in self.dockings:
            deepest[docking.a, docking.b] = max(deepest.get((docking.a, docking.b), 0.0), docking.depth)
        return deepest


@dataclass(frozen=True)
class Exemplar:
    """An input shape: its assembly, the name of each part in the file it came from, and, without their contacts, the
    hub parts that are not in the assembly but stand behind it."""

    name: str
    assembly: Assembly
    part_names: tuple[str, ...]
    removed_hubs: Assembly = field(default_factory=lambda: EMPTY_ASSEMBLY)

    @property
    def whole(self) -> Assembly:
        """The assembly and its backdrop, without the contacts of the latter: for pictures."""
        front, behind = self.assembly, self.removed_hubs
        types, poses = np.concatenate([front.types, behind.types]), np.concatenate([front.poses, behind.poses])
        return Assembly(types, poses, front.edges)


@dataclass(frozen=True)
class Kit:
    """Part types, exemplars and grammar.

    contact_tolerance: largest distance of two parts in contact, in the kit's units.
    pose_tolerance: largest displacement of relative poses that are one docking, in the kit's units.
    contact_kinds: the kinds of contact that make neighbours.
    up: the axis that points up in the exemplars' coordinates, `"y"` or `"z"`.
    one_surface: whether its parts are pieces that one surface was cut into; then no line is seen where they meet.
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

    def type_names(self) -> tuple[str, ...]:
        """Names of the types, in order."""
        return tuple(part_type.name for part_type in self.types)

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """What parts of the kit are called, each once; without types by meaning these are the names of the types."""
        return labels_of(self.types)[0]

    @property
    def by_meaning(self) -> bool:
        """Whether parts of several shapes have one label."""
        return len(self.labels) < len(self.types)

    @cached_property
    def label_of(self) -> TypeArray:
        """For each type the place of its label in `labels`, int16 (types,)."""
        return labels_of(self.types)[1]

    def labelled(self, assembly: Assembly) -> Assembly:
        """`assembly` with the places of labels instead of types: the shape graph that the grammar speaks of."""
        return replace(assembly, types=self.label_of[assembly.types])
