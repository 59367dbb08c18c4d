"""Samples of a finished dataset as files of other tools."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Literal, get_args

import numpy as np

from pipeline.errors import ConfigError
from stages.export.formats import shape_files
from stages.export.settings import ExportSettings
from stages.export.structurenet import structurenet_files
from stages.package.dataset_sample import DatasetSample
from stages.programs.language import LANGUAGE as PROGRAM_LANGUAGE
from stages.programs.program import shape_from_text
from stages.shape.collection.pairs import JOINTS, pairs_of
from stages.shape.part_joint import PartJoint
from stages.shape.shape import Shape

ExportFormat = Literal["urdf", "mjcf", "usd", "obj", "structurenet"]
FORMATS: tuple[ExportFormat, ...] = get_args(ExportFormat)


def export_files(sample: DatasetSample, kind: ExportFormat, settings: ExportSettings) -> Mapping[str, bytes]:
    """Return the files of a sample in a format, by their paths below its folder.

    Raises ValueError for a shape without weight or, in StructureNet's format, without a hierarchy. Raises ConfigError
    where its program has changed.
    """
    if kind == "structurenet":
        return structurenet_files(sample.key, shape_of_sample(sample), sample.contacts.T, sample.record)
    return shape_files(kind, sample.key, shape_of_sample(sample), pairs_of(sample.members[JOINTS]), settings)


def shape_of_sample(sample: DatasetSample) -> Shape:
    """Return the shape of a sample with its parts in the order of the record, and the joints that its program knows."""
    record, shape = sample.record, sample.shape
    place_of = {name: place for place, name in enumerate(shape.part_names)}
    names = tuple(part["name"] for part in record["parts"])
    order = np.array([place_of[name] for name in names])
    assembly = replace(shape.assembly, types=shape.assembly.types[order], poses=shape.assembly.poses[order])
    return replace(shape, assembly=assembly, own_names=names, part_joints=_joints(sample))


def _joints(sample: DatasetSample) -> tuple[PartJoint | None, ...]:
    """Return the joints of the parts of a sample; empty if nothing is known to move."""
    record = sample.record
    if record["language"] != PROGRAM_LANGUAGE.name:
        return ()
    built = shape_from_text(record["kit"], record["text"])
    recorded = np.array([part["pose"] for part in record["parts"]])
    if built.assembly.poses.shape != recorded.shape or not np.allclose(built.assembly.poses, recorded, atol=1e-5):
        remedy = "make the dataset again with `make dataset`"
        raise ConfigError(f"{sample.key}: program {record['kit']} has changed since the sample was made; {remedy}")
    return built.part_joints
