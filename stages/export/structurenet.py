"""The part hierarchy of a sample in StructureNet's JSON: nested labels and boxes, with the relations of siblings."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.pose import transform_points
from stages.shape.shape import Shape

RELATIONS = {"mirror": "REF_SYM", "rotation": "ROT_SYM"}
"""StructureNet's names of symmetries."""
BOX_DECIMALS = 7


def structurenet_files(name: str, shape: Shape, contacts: IntArray, record: Mapping[str, Any]) -> Mapping[str, bytes]:
    """Return the file of an upright shape, y up, by its name.

    contacts: pairs of parts that touch, int32 (m, 2)
    record: of the sample, with `hierarchy`, and with `symmetry` if siblings are to be related by it

    The box of a part is that of its mesh in its own coordinates, and the box of a group is upright. Raises ValueError
    for a record without `hierarchy`.
    """
    if "hierarchy" not in record:
        raise ValueError("its record has no hierarchy; make the dataset with `structure: {hierarchy: true}`")
    root = _Writer(shape, contacts, record).group(0)
    return {f"{name}.json": json.dumps(root, separators=(",", ":")).encode()}


class _Writer:
    """Nodes of one shape, numbered in the order in which they are written."""

    def __init__(self, shape: Shape, contacts: IntArray, record: Mapping[str, Any]) -> None:
        hierarchy = record["hierarchy"]
        self._shape, self._contacts = shape, {tuple(pair) for pair in contacts.tolist()}
        self._groups: Sequence[Mapping[str, Any]] = hierarchy["groups"]
        self._part_groups: Sequence[int] = hierarchy["part_groups"]
        self._operations: Sequence[Mapping[str, Any]] = record.get("symmetry", {}).get("operations", ())
        self._count = 0

    def group(self, index: int) -> dict[str, Any]:
        """Return a group with its parts and groups."""
        node = self._node(str(self._groups[index]["name"]), self._upright_box(self._members(index)))
        parts = [part for part, group in enumerate(self._part_groups) if group == index]
        below = [other for other, group in enumerate(self._groups) if group["parent"] == index]
        members = [[part] for part in parts] + [self._members(group) for group in below]
        node["children"] = [self._part(part) for part in parts] + [self.group(group) for group in below]
        node["edges"] = [
            {"part_a": first, "part_b": second, "type": relation}
            for first in range(len(members))
            for second in range(first + 1, len(members))
            for relation in self._relations(members[first], members[second])
        ]
        return node

    def _node(self, label: str, box: Sequence[float]) -> dict[str, Any]:
        self._count += 1
        return {"id": self._count - 1, "label": label, "box": [round(number, BOX_DECIMALS) + 0.0 for number in box]}

    def _part(self, part: int) -> dict[str, Any]:
        mesh, pose = self._shape.meshes[self._shape.assembly.types[part]], self._shape.assembly.poses[part]
        low, high = mesh.bounds
        centre = transform_points(pose, ((low + high) / 2)[None])[0]
        label = self._shape.labels[self._shape.part_labels[part]]
        return self._node(label, [*centre, *(high - low), *pose[:3, 0], *pose[:3, 1]])

    def _members(self, group: int) -> list[int]:
        """Return all parts in a group and the groups below it."""
        inside = {group}
        for index, other in enumerate(self._groups):
            if other["parent"] in inside:
                inside.add(index)
        return [part for part, own in enumerate(self._part_groups) if own in inside]

    def _upright_box(self, parts: Sequence[int]) -> list[float]:
        points: FloatArray = np.concatenate(
            [
                transform_points(
                    self._shape.assembly.poses[part], self._shape.meshes[self._shape.assembly.types[part]].vertices
                )
                for part in parts
            ]
        )
        low, high = points.min(axis=0), points.max(axis=0)
        return [*((low + high) / 2), *(high - low), 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]

    def _relations(self, first: Sequence[int], second: Sequence[int]) -> list[str]:
        """Return how two siblings, each given by its parts, are related."""
        found = []
        if any((min(a, b), max(a, b)) in self._contacts for a in first for b in second):
            found.append("ADJ")
        for kind, relation in RELATIONS.items():
            if any(
                operation["kind"] == kind and {operation["images"][part] for part in first} == set(second)
                for operation in self._operations
            ):
                found.append(relation)
        return found
