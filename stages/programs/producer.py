"""Stage `programs` as a producer of samples."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pipeline.config import Config
from pipeline.stage import Plan
from stages.programs.description import program_markdown
from stages.programs.program import find_program
from stages.programs.settings import ProgramsConfig
from stages.shape.collection.members import RecordField
from stages.shape.collection.producer import Producer


def _card(plan: Plan) -> Sequence[str]:
    programs = plan.config.section(ProgramsConfig).sampled
    return [program_markdown(find_program(entry.program)).rstrip() for entry in programs]


def _splits(config: Config) -> str:
    text = "No two shapes of a program have equal parameters, within a split or across splits. "
    if config.section(ProgramsConfig).sampled[0].mode == "all_values":
        return text + "All splits have all values of all parameters, as published."
    return text + (
        "Samples that differ in continuous parameters alone are in one split where `split_by` in their lineage is "
        "`structure`. Where it is `values`, the program has fewer structures than splits, and splits share structures."
    )


def _lineage(config: Config) -> Mapping[str, RecordField]:
    if config.section(ProgramsConfig).sampled[0].mode == "random":
        difference = "how splits differ: in `structure`, the discrete parameters, or in `values` of any parameters"
        return {"split_by": RecordField({"enum": ["structure", "values"], "description": difference})}
    return {
        "parameter": RecordField(
            {"type": "string", "minLength": 1, "description": "the parameter whose value was fixed"}
        ),
        "class": RecordField(
            {"type": "integer", "minimum": 0, "description": "index of that value among the parameter's"}
        ),
    }


PRODUCER = Producer(
    language="program",
    keys="programs.program",
    is_requested=lambda config: bool(config.section(ProgramsConfig).sampled),
    sentence=lambda _: "a program builds shapes from random parameters; the parameters of a shape are its `txt`.",
    splits=_splits,
    graphs_share_split=lambda _: False,
    lineage=_lineage,
    limits=lambda _: ("All shapes of a program have its parameters; shapes that it cannot build are missing.",),
    card=_card,
)
