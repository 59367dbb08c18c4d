"""What stage `programs` says of itself as a producer of samples."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pipeline.config import Config
from pipeline.stage import Plan
from stages.programs.description import program_markdown
from stages.programs.program import find_program
from stages.programs.settings import ProgramsConfig
from stages.shape.collection.members import RecordField
from stages.shape.collection.producer import Producer


def _recipe(plan: Plan) -> Sequence[str]:
    return [program_markdown(find_program(plan.config.section(ProgramsConfig).program)).rstrip()]


def _lineage(config: Config) -> Mapping[str, RecordField]:
    if config.section(ProgramsConfig).mode == "random":
        kept = "what keeps the splits apart: `structure`, the discrete parameters, or `values`, all parameters together"
        return {"apart": RecordField({"enum": ["structure", "values"], "description": kept})}
    return {
        "parameter": RecordField(
            {"type": "string", "minLength": 1, "description": "the parameter whose value was asked for"}
        ),
        "class": RecordField(
            {"type": "integer", "minimum": 0, "description": "place of that value among the parameter's"}
        ),
    }


PRODUCER = Producer(
    language="program",
    keys="programs.program",
    asked=lambda config: bool(config.section(ProgramsConfig).program),
    sentence="curve programs are run on parameters drawn from their ranges; a shape's parameters are its `txt`.",
    splits="No two samples are alike, within a split or across splits. In a plain sweep, samples that are alike up to "
    "their continuous parameters stand in one split, if their `lineage` says `apart: structure`; where it says "
    "`apart: values`, the program has fewer structures than splits, and shapes of one structure stand in all of them. "
    "Where every value of every parameter is sampled, all splits have all values, as published.",
    graphs_share_split=False,
    lineage=_lineage,
    limits=("All shapes are values of the same parameters; what the program cannot say is not there.",),
    card=_recipe,
)
