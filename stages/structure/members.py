"""What stage `structure` adds to every sample: fields of its record."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pipeline.config import Config
from stages.shape.collection.members import Members, RecordField, object_schema
from stages.structure.settings import StructureConfig

HIERARCHY, SYMMETRY = "hierarchy", "symmetry"


def _list_of(item: Mapping[str, Any], description: str) -> dict[str, Any]:
    return {"type": "array", "items": item, "minItems": 1, "description": description}


def _hierarchy() -> dict[str, Any]:
    group = object_schema(
        "a group",
        {
            "name": {"type": "string", "minLength": 1},
            "parent": {"type": "integer", "minimum": -1, "description": "group that it belongs to; -1 for the root"},
        },
    )
    numbers = {"type": "integer", "minimum": 0}
    return object_schema(
        "groups of parts: assemblies of a ShapeAssembly program; parts of a program that move together; or, of the "
        "parts of models, those below one node of their model, and rows of congruent parts at equal steps; one group "
        "where nothing of this is known; several are nodes of the GLB, above those of their parts",
        {
            "groups": _list_of(group, "all groups, parents first"),
            "part_groups": _list_of(numbers, "group of each part, in the order of `parts`"),
        },
    )


def _symmetry() -> dict[str, Any]:
    part = {"type": "integer", "minimum": 0}
    operation = object_schema(
        "a symmetry",
        {
            "kind": {
                "enum": ["rotation", "mirror"],
                "description": "about the axis, or in a plane through it",
            },
            "degrees": {
                "type": "number",
                "description": "of the rotation, or azimuth of the normal of the plane, 0 along x and 90 along -z",
            },
            "images": _list_of(part, "part that each part is mapped onto"),
        },
    )
    axis = {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2}
    return object_schema(
        "rotations about the vertical, of an order of at most 12, and upright mirrors that map the parts onto parts of "
        "the same label, area and vertices, within a thousandth of the diagonal",
        {
            "axis": {**axis, "description": "x and z of the vertical axis"},
            "operations": _list_of(operation, "the symmetries; the first is the identity"),
            "orbits": _list_of(part, "orbit of each part: parts that symmetries map onto each other share a number"),
        },
    )


def _fields(config: Config) -> Mapping[str, RecordField]:
    section = config.section(StructureConfig)
    fields: dict[str, RecordField] = {}
    if section.hierarchy:
        fields[HIERARCHY] = RecordField(_hierarchy())
    if section.symmetry:
        fields[SYMMETRY] = RecordField(_symmetry())
    return fields


MEMBERS = Members(of=lambda _: (), fields=_fields)
