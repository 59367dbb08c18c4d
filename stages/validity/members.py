"""What stage `validity` adds to every sample: which parts touch, which are connected, and whether it stands."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pipeline.config import Config
from stages.shape.collection.members import IndexColumn, Member, Members, RecordField
from stages.shape.collection.pairs import CONTACTS, JOINTS
from stages.validity.settings import ValidityConfig


def _number(description: str, **limits: float) -> dict[str, Any]:
    return {"type": "number", "description": description, **limits}


def _count(description: str) -> dict[str, Any]:
    return {"type": "integer", "minimum": 0, "description": description}


PHYSICS: Mapping[str, Mapping[str, Any]] = {
    "rooted": {"type": "boolean", "description": "every part is connected to the ground by a chain of joints"},
    "stable": {"type": "boolean", "description": "the shape stands and bears small pushes"},
    "margin": _number("largest push that it bears, in weights; -1: it does not stand"),
    "weakest": {
        "type": "integer",
        "minimum": -1,
        "description": "place of the part that gives way first; -1: none",
    },
    "tipping_degrees": _number("by how much the ground may tilt; negative: it tips over on level ground"),
    "components": {
        "type": "integer",
        "minimum": 1,
        "description": "pieces that its joints make; fewer than counts.pieces where parts that do not touch are near "
        "enough to count as connected",
    },
    "floating": _count("parts that no chain of joints connects to the ground"),
    "penetration": _number("volume that lies in two parts, as a share of all", minimum=0),
    "ground": _number("area stood on, as a share of the outline from above", minimum=0),
    "symmetry": _number("share of the weight that an upright mirror maps to its like", minimum=0),
    "weighed": {
        "enum": ["volume", "area"],
        "description": "whether parts weigh by volume or, where they are open, by area",
    },
}


FALLS: Mapping[str, Mapping[str, Any]] = {
    "falls": {
        "type": "boolean",
        "description": "dropped on the ground and pushed by a tenth of its weight, a piece of it comes to rest with "
        "its centre of mass 2.5 % higher or lower; connected parts are one rigid body, and what no chain of joints "
        "connects to the ground falls",
    },
    "fall_degrees": _number("least tilt of the ground after which it falls; 0: by itself; 90: never", minimum=0),
    "fallen": {
        "type": "integer",
        "minimum": -1,
        "description": "place of the first part of the piece that falls at this tilt, or of the first part that no "
        "chain of joints connects to the ground; -1: none",
    },
}
"""What `validity.falls` adds."""


def _members(_: Config) -> tuple[Member, ...]:
    return (
        Member(
            CONTACTS,
            "Contact graph: pairs of parts at most `contact_tolerance` apart, by their places in the record, one a "
            "column, the lower place first.",
            "int32",
            (2, "contacts"),
        ),
        Member(
            JOINTS,
            "Pairs of parts that count as connected in `physics`: those that overlap, are in contact, or are at most "
            "`joint_tolerance` apart. Written as the contacts are.",
            "int32",
            (2, "joints"),
        ),
    )


def _fields(config: Config) -> Mapping[str, RecordField]:
    facts = {**PHYSICS, **FALLS} if config.section(ValidityConfig).falls else PHYSICS
    return {
        "physics": RecordField(
            {
                "description": "does it stand? By statics on its geometry; the pairs of joints.npy hold together",
                "type": "object",
                "properties": facts,
                "required": list(facts),
                "additionalProperties": False,
            }
        ),
        "contact_tolerance": RecordField(
            _number("largest distance of parts in contact, in the units of the shape", exclusiveMinimum=0)
        ),
        "joint_tolerance": RecordField(
            _number(
                "largest distance of parts that count as connected in physics, and of parts that stand from the ground",
                minimum=0,
            )
        ),
    }


MEMBERS = Members(
    of=_members,
    fields=_fields,
    columns={
        "rooted": IndexColumn("bool", ("physics", "rooted")),
        "stable": IndexColumn("bool", ("physics", "stable")),
        "margin": IndexColumn("float64", ("physics", "margin")),
        "falls": IndexColumn("bool", ("physics", "falls")),
        "fall_degrees": IndexColumn("float64", ("physics", "fall_degrees")),
    },
)
