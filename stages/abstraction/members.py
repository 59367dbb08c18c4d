"""The member that stage `abstraction` adds to samples: a ShapeAssembly program of their parts' boxes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pipeline.config import Config
from pipeline.stage import Plan
from stages.abstraction.settings import AbstractionConfig
from stages.shape.collection.members import Member, Members, RecordField

PROGRAM = "program.txt"
PROGRAM_FOUND = "not refused"
"""Value of `refused` in the record of a sample with a program."""


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
            "description": "agreement of its cuboids with the boxes of the parts, percent",
        },
        "lines": {"type": "integer", "minimum": 0, "description": "number of lines in all assemblies"},
        "leaves": {"type": "integer", "minimum": 0, "description": "number of cuboids that it does not expand"},
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
    """Return the numbers of samples and programs, and means of F-scores and lines; None without samples."""
    summaries = [plan.summary("abstraction", name) or {} for name in plan.shards("abstraction")]
    done = [summary for summary in summaries if summary]
    samples, programs = (sum(summary[name] for summary in done) for name in ("samples", "programs"))
    if not samples:
        return None
    means = {name: sum(summary[name] for summary in done) / max(programs, 1) for name in ("f_score", "lines")}
    return {"samples": samples, "programs": programs, **means}


def _card(plan: Plan) -> Sequence[str]:
    totals = figures(plan)
    if totals is None:
        return []
    return [
        f"{totals['programs']:,} of {totals['samples']:,} samples have a ShapeAssembly program of their parts' boxes "
        f"(`{PROGRAM}`), with {totals['lines']:.1f} lines and an F-score of {totals['f_score']:.1f} % on average."
    ]


MEMBERS = Members(of=_members, fields=_fields, card=_card)
