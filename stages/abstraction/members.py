"""What stage `abstraction` adds to every sample: a ShapeAssembly program of its parts' boxes, where it has one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pipeline.config import Config
from pipeline.stage import Plan
from stages.abstraction.settings import AbstractionConfig
from stages.shape.collection.members import Member, Members, RecordField

PROGRAM = "program.txt"
PROGRAM_FOUND = "not refused"
"""What a record says of a sample that has a program."""


def _members(config: Config) -> tuple[Member, ...]:
    if not config.section(AbstractionConfig).programs:
        return ()
    return (Member(PROGRAM, "A ShapeAssembly program of the boxes of its parts; empty where none was found."),)


def _fields(config: Config) -> Mapping[str, RecordField]:
    if not config.section(AbstractionConfig).programs:
        return {}
    properties = {
        "refused": {
            "type": "string",
            "minLength": 1,
            "description": f"why it has none; {PROGRAM_FOUND!r} where it has one",
        },
        "f_score": {
            "type": "number",
            "minimum": 0,
            "maximum": 100,
            "description": "how well its cuboids agree with the boxes of the parts, percent",
        },
        "lines": {"type": "integer", "minimum": 0, "description": "its lines, those of all assemblies"},
        "leaves": {"type": "integer", "minimum": 0, "description": "cuboids that it declares and does not expand"},
        "centre": {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3},
        "scale": {"type": "number", "minimum": 0, "description": "centre + scale * its coordinates are the mesh's"},
    }
    return {
        "program": RecordField(
            {
                "description": "how its ShapeAssembly program was found",
                "type": "object",
                "properties": properties,
                "required": list(properties),
                "additionalProperties": False,
            }
        )
    }


def figures(plan: Plan) -> Mapping[str, float] | None:
    """Samples looked at, programs found, and the means of their F-scores and lines; None while there are none."""
    done = [each for each in (plan.summary("abstraction", name) for name in plan.shards("abstraction")) if each]
    samples, programs = (sum(each[name] for each in done) for name in ("samples", "programs"))
    if not samples:
        return None
    means = {name: sum(each[name] for each in done) / max(programs, 1) for name in ("f_score", "lines")}
    return {"samples": samples, "programs": programs, **means}


def _card(plan: Plan) -> Sequence[str]:
    found = figures(plan)
    if found is None:
        return []
    return [
        f"{found['programs']:,} of {found['samples']:,} samples have a ShapeAssembly program of their parts' boxes "
        f"(`{PROGRAM}`), of {found['lines']:.1f} lines in the mean, with a mean F-score of {found['f_score']:.1f} %."
    ]


MEMBERS = Members(of=_members, fields=_fields, card=_card)
