"""What stage `validity` adds to every sample: no member of its own, but fields of the record."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pipeline.config import Config
from stages.shape.collection.members import Column, Field, Members

__all__ = ["MEMBERS"]


def _number(description: str, **limits: float) -> dict[str, Any]:
    return {"type": "number", "description": description, **limits}


def _count(description: str) -> dict[str, Any]:
    return {"type": "integer", "minimum": 0, "description": description}


PHYSICS: Mapping[str, Mapping[str, Any]] = {
    "rooted": {"type": "boolean", "description": "every part is connected to the ground"},
    "stable": {"type": "boolean", "description": "the shape stands and bears small pushes"},
    "margin": _number("largest push that it bears, in weights; -1: it does not stand"),
    "weakest": {"type": "integer", "description": "place of the part that gives way first; -1: none"},
    "tipping_degrees": _number("by how much the ground may tilt; negative: it tips over on level ground"),
    "components": {"type": "integer", "minimum": 1, "description": "pieces that are not connected with each other"},
    "floating": _count("parts that nothing connects to the ground"),
    "penetration": _number("volume that lies in two parts, as a share of all", minimum=0),
    "ground": _number("area stood on, as a share of the outline from above", minimum=0),
    "symmetry": _number("share of the weight that an upright mirror maps to its like", minimum=0),
    "weighed": {"type": "string", "description": "whether parts weigh by volume or, where they are open, by area"},
}


def _fields(_: Config) -> Mapping[str, Field]:
    return {
        "physics": Field(
            {
                "description": "does it stand? By statics on its geometry, its parts being one rigid body where they "
                "are connected",
                "type": "object",
                "properties": PHYSICS,
                "required": list(PHYSICS),
                "additionalProperties": False,
            }
        ),
        "contacts": Field(
            {
                "description": "pairs of parts that touch, by their places, the lower one first",
                "type": "array",
                "items": {"type": "array", "items": {"type": "integer", "minimum": 0}, "minItems": 2, "maxItems": 2},
            }
        ),
    }


MEMBERS = Members(
    of=lambda _: (),
    fields=_fields,
    columns={
        "rooted": Column("bool", ("physics", "rooted")),
        "stable": Column("bool", ("physics", "stable")),
        "margin": Column("float64", ("physics", "margin")),
    },
)
