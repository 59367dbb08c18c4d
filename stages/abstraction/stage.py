"""Stage `abstraction`: a ShapeAssembly program of each sample, if the config asks for it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pipeline.errors import Rejected
from pipeline.shards import json_bytes
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.abstraction.hierarchy import Boxes, part_hierarchy
from stages.abstraction.members import PROGRAM, PROGRAM_FOUND, figures
from stages.abstraction.settings import AbstractionConfig
from stages.shape.collection.collection import Collection, add_members
from stages.shape.collection.shards import PRODUCERS, collection_shards, sample_count
from stages.shape.sample import Sample
from stages.shapeassembly.extraction.category_rules import CATEGORY_RULES
from stages.shapeassembly.extraction.extract import ExtractedProgram, extract
from stages.shapeassembly.syntax.printer import print_program

BYTES_PER_SAMPLE = 4096


def plan(plan: Plan) -> list[Shard]:
    """Plan one shard for each shard of the collection, if programs are asked for."""
    return collection_shards(plan) if plan.config.section(AbstractionConfig).programs else []


def run_shard(task: Task) -> Outcome:
    """Write the members of `members.py` for each sample; the summary has sums over all programs."""
    config = task.config.section(AbstractionConfig)
    boxes = Boxes()
    sums: dict[str, float] = {"programs": 0, "f_score": 0.0, "lines": 0}

    def abstracted(collection: Collection, sample: Sample) -> Mapping[str, bytes]:
        shape = collection.shape(sample)
        try:
            hierarchy = part_hierarchy(shape, config.children, boxes)
            extracted = extract(hierarchy, CATEGORY_RULES["any"], config.gates, config.cleaning)
        except Rejected as error:
            nothing = {"refused": error.reason, "f_score": 0, "lines": 0, "leaves": 0, "centre": [0, 0, 0], "scale": 0}
            return {PROGRAM: b"", "json": json_bytes({"program": nothing})}
        fields = _fields(extracted)
        sums["programs"] += 1
        sums["f_score"] += fields["f_score"]
        sums["lines"] += fields["lines"]
        return {PROGRAM: print_program(extracted.program).encode(), "json": json_bytes({"program": fields})}

    samples = add_members(task, abstracted)
    return Outcome(samples, {"split": task.shard.params["split"], "samples": samples, **sums})


def _fields(extracted: ExtractedProgram) -> dict[str, Any]:
    return {
        "refused": PROGRAM_FOUND,
        "f_score": round(extracted.f_score, 3),
        "lines": sum(1 + len(block.lines) for block in extracted.program.blocks),
        "leaves": extracted.leaves,
        "centre": [float(f"{coordinate:.9g}") for coordinate in extracted.center],
        "scale": float(f"{extracted.scale:.9g}"),
    }


def report(plan: Plan) -> Sequence[str]:
    """Describe how many samples have a program, and how well these fit."""
    totals = figures(plan)
    if totals is None:
        return []
    return [
        f"{totals['programs']:,} of {totals['samples']:,} samples have a program, "
        f"mean F-score {totals['f_score']:.1f} %, {totals['lines']:.1f} lines"
    ]


def _bytes(plan: Plan) -> int:
    return BYTES_PER_SAMPLE * sample_count(plan) if plan.config.section(AbstractionConfig).programs else 0


STAGE = Stage(
    name="abstraction",
    module=__name__,
    config=AbstractionConfig,
    inputs=(PRODUCERS,),
    plan=plan,
    run_shard=run_shard,
    estimate_bytes=_bytes,
    report=report,
)
