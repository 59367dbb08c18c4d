"""A shape: the geometry of one sample, whatever made it, as points, sketches, package and eval read it."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from stages.shape.arrays import FloatArray, TypeArray
from stages.shape.kit import Assembly, Kit, PartMesh
from stages.shape.stretch import StretchedMesh, bake, placements

Z_TO_Y = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


@dataclass(frozen=True)
class Shape:
    """Parts with meshes, poses and labels.

    meshes: what `assembly.types` counts into; of a kit all its types, of a program, or where parts are stretched, the
    meshes of this one shape.
    assembly: which mesh stands where, and which parts touch; its edges are empty where nobody has asked yet.
    up: the axis that points up, `"y"` or `"z"`; labels: the vocabulary of part labels, the same for every shape of
    one kit or program, in a fixed order. The label of each mesh is one of them.
    own_names: a name for each part that no other part of the shape has; without, its mesh's name and a number.
    first_class: in a dataset the id of the class of the first of `labels`; the others follow.
    one_surface: whether its parts are pieces of one surface, so that no line is seen where one goes on in the next.
    """

    meshes: tuple[PartMesh, ...]
    assembly: Assembly
    up: Literal["y", "z"]
    labels: tuple[str, ...]
    own_names: tuple[str, ...] = ()
    first_class: int = 0
    one_surface: bool = False

    @cached_property
    def label_of(self) -> TypeArray:
        """For each mesh the index of its label in `labels`, int16 (k,)."""
        places = {name: index for index, name in enumerate(self.labels)}
        return np.array([places[mesh.label] for mesh in self.meshes], dtype=np.int16)

    @cached_property
    def part_labels(self) -> TypeArray:
        """For each part the index of its label in `labels`, int16 (n,)."""
        labels: TypeArray = self.label_of[self.assembly.types]
        return labels

    @cached_property
    def part_classes(self) -> TypeArray:
        """For each part the id of its class in the dataset, int16 (n,)."""
        return (self.part_labels + np.int16(self.first_class)).astype(np.int16)

    @cached_property
    def part_names(self) -> tuple[str, ...]:
        """A name for each part: its own, or its mesh's name and a number, `tower.000`."""
        if self.own_names:
            return self.own_names
        counts: Counter[str] = Counter()
        names = []
        for mesh in self.assembly.types.tolist():
            name = self.meshes[mesh].name
            names.append(f"{name}.{counts[name]:03d}")
            counts[name] += 1
        return tuple(names)

    @property
    def placements(self) -> FloatArray:
        """What moves each part's mesh as its kit has it, float64 (n, 4, 4): its pose, but of a stretched part."""
        return placements(self.meshes, self.assembly)

    @property
    def is_stretched(self) -> bool:
        """Whether parts of it are stretched, so that its meshes are not those of its kit."""
        return any(isinstance(mesh, StretchedMesh) for mesh in self.meshes)

    def __len__(self) -> int:
        return len(self.assembly)


def kit_shape(kit: Kit, assembly: Assembly) -> Shape:
    """The shape of an assembly of the kit's types; parts that are stretched have meshes of their own."""
    meshes, baked = bake(kit.types, assembly)
    return Shape(meshes, baked, kit.up, kit.labels, one_surface=kit.one_surface)


def mesh_name(part_name: str) -> str:
    """The name of the mesh of a part that has no name of its own, by what `Shape.part_names` calls it."""
    return part_name.rpartition(".")[0]


def part_count(shape: Shape) -> str:
    """How many parts a shape has, in words."""
    return f"{len(shape)} part{'' if len(shape) == 1 else 's'}"


def upright(shape: Shape) -> Shape:
    """`shape` turned so that y points up, which is a quarter turn about x where z points up."""
    if shape.up == "y":
        return shape
    # adding zero turns the minus zeros of the product into zeros, which read better in text
    return replace(shape, assembly=replace(shape.assembly, poses=Z_TO_Y @ shape.assembly.poses + 0.0), up="y")
