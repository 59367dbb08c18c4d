"""Stage `structure`: the hierarchy and the symmetry of each sample, where the config asks for them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pipeline.shards import json_bytes
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.mixture.contrast import described_language
from stages.shape.collection.collection import Collection, add_members
from stages.shape.collection.discovery import language_of
from stages.shape.collection.shards import PRODUCERS, collection_shards, sample_count
from stages.shape.sample import Sample
from stages.shape.shape import Shape
from stages.structure.hierarchy import hierarchy_of
from stages.structure.members import HIERARCHY, SYMMETRY
from stages.structure.settings import StructureConfig

BYTES_A_SAMPLE = 4096


def plan(plan: Plan) -> list[Shard]:
    """Plan one shard for each shard of the collection, if the config asks for anything."""
    return collection_shards(plan) if plan.config.section(StructureConfig).is_requested else []


def run_shard(task: Task) -> Outcome:
    """Make the fields of each sample's record that `members.py` declares."""
    config = task.config.section(StructureConfig)

    def described(collection: Collection, sample: Sample) -> Mapping[str, bytes]:
        language = described_language(language_of(sample.producer).name, sample.text)
        return {"json": json_bytes(structure_fields(collection.shape(sample), language, config))}

    return Outcome(add_members(task, described), {"split": task.shard.params["split"]})


def structure_fields(shape: Shape, language: str, config: StructureConfig) -> dict[str, Any]:
    """Return the fields of the record of an upright shape. language: that names its parts, as records call it"""
    from stages.structure.symmetry import shape_symmetry

    fields: dict[str, Any] = {}
    if config.hierarchy:
        hierarchy = hierarchy_of(shape, language)
        groups = [{"name": name, "parent": parent} for name, parent in hierarchy.groups]
        fields[HIERARCHY] = {"groups": groups, "part_groups": list(hierarchy.part_groups)}
    if config.symmetry:
        symmetry = shape_symmetry(shape)
        operations = [
            {"kind": found.kind, "degrees": found.degrees, "images": list(found.images)}
            for found in symmetry.operations
        ]
        axis = [round(place, 6) + 0.0 for place in symmetry.axis]
        fields[SYMMETRY] = {"axis": axis, "operations": operations, "orbits": list(symmetry.orbits)}
    return fields


def estimate_bytes(plan: Plan) -> int:
    """Estimate the bytes of all fields."""
    return BYTES_A_SAMPLE * sample_count(plan) if plan.config.section(StructureConfig).is_requested else 0


STAGE = Stage(
    name="structure",
    module=__name__,
    config=StructureConfig,
    inputs=(PRODUCERS,),
    plan=plan,
    run_shard=run_shard,
    estimate_bytes=estimate_bytes,
)
