"""A shape: the geometry of one sample as points, sketches, packaging and eval read it, whatever made it."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from stages.shape.arrays import FloatArray, TypeArray
from stages.shape.exemplar_looks import with_looks
from stages.shape.kit import Assembly, Kit, LengthUnit, PartGroup, PartMesh
from stages.shape.part_joint import PartJoint
from stages.shape.stretch import StretchedMesh, bake, placements

Z_TO_Y = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


@dataclass(frozen=True)
class Shape:
    """Parts with meshes, poses and labels.

    meshes: what `assembly.types` indexes; all types of a kit, or the meshes of this shape alone
    assembly: pose and mesh of each part, and which parts touch; its edges are empty until contacts are computed
    up: axis that points up
    labels: vocabulary of part labels in a fixed order, the same for every shape of one kit or program
    own_names: unique name of each part; if empty, its mesh's name and a number
    class_ids: class of each label in a dataset; empty outside of one, where a label's index is its class
    one_surface: whether the parts were cut from one surface, so that no line is drawn where they meet
    unit: unit of all coordinates
    part_joints: joint of each part, None for a part that stays; if empty, no part moves
    groups: groups that its source names; the shape has those whose parts it has at these places
    """

    meshes: tuple[PartMesh, ...]
    assembly: Assembly
    up: Literal["y", "z"]
    labels: tuple[str, ...]
    own_names: tuple[str, ...] = ()
    class_ids: tuple[int, ...] = ()
    one_surface: bool = False
    unit: LengthUnit = "unknown"
    part_joints: tuple[PartJoint | None, ...] = ()
    groups: tuple[PartGroup, ...] = ()

    @cached_property
    def label_of(self) -> TypeArray:
        """Index of each mesh's label in `labels`, int16 (k,)."""
        index_of = {name: index for index, name in enumerate(self.labels)}
        return np.array([index_of[mesh.label] for mesh in self.meshes], dtype=np.int16)

    @cached_property
    def part_labels(self) -> TypeArray:
        """Index of each part's label in `labels`, int16 (n,)."""
        labels: TypeArray = self.label_of[self.assembly.types]
        return labels

    @property
    def used_labels(self) -> tuple[str, ...]:
        """The labels of its parts, each once, in the order of `labels`."""
        return tuple(self.labels[label] for label in np.unique(self.part_labels))

    @cached_property
    def part_classes(self) -> TypeArray:
        """Class id of each part in the dataset, int16 (n,)."""
        if not self.class_ids:
            return self.part_labels
        classes: TypeArray = np.array(self.class_ids, dtype=np.int16)[self.part_labels]
        return classes

    @cached_property
    def part_names(self) -> tuple[str, ...]:
        """Name of each part: its own, or its mesh's name and a number, such as `tower.000`."""
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
        """Transform of each part's unstretched mesh into the world, float64 (n, 4, 4)."""
        return placements(self.meshes, self.assembly)

    @property
    def is_stretched(self) -> bool:
        """Whether any part is stretched."""
        return any(isinstance(mesh, StretchedMesh) for mesh in self.meshes)

    def __len__(self) -> int:
        return len(self.assembly)


def kit_shape(kit: Kit, assembly: Assembly) -> Shape:
    """Return the shape of an assembly of the kit's types.

    Stretched parts, and parts in another look than the first one of their type, have meshes of their own.
    """
    meshes, baked = bake(*with_looks(kit, assembly))
    return Shape(meshes, baked, kit.up, kit.labels, one_surface=kit.one_surface, unit=kit.unit, groups=kit.groups)


def mesh_name(part_name: str) -> str:
    """Return the name of a part's mesh from the part's name in `Shape.part_names`, if it has no name of its own."""
    return part_name.rpartition(".")[0]


def part_count(shape: Shape) -> str:
    """Return the number of parts in words."""
    return f"{len(shape)} part{'' if len(shape) == 1 else 's'}"


def upright(shape: Shape) -> Shape:
    """Return `shape` turned so that y points up: a quarter turn about x if z points up."""
    if shape.up == "y":
        return shape
    # adding zero turns the minus zeros of the product into zeros, which read better in text
    poses = Z_TO_Y @ shape.assembly.poses + 0.0
    joints = tuple(joint and joint.transformed(Z_TO_Y) for joint in shape.part_joints)
    return replace(shape, assembly=replace(shape.assembly, poses=poses), up="y", part_joints=joints)
