"""The programs of a category that generated shapes are compared with, read and sampled once for all models."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from eval.engine.dataset_run import DatasetRun
from eval.programs.models import read_category_programs
from eval.programs.quality import boxes_of_programs, clouds_of
from eval.programs.two_sample_test import POINTS_PER_CLOUD, features_of
from stages.shape.arrays import FloatArray
from stages.shapeassembly.syntax.program import AssemblyProgram


@dataclass(frozen=True)
class ReferencePrograms:
    """The programs of a category, and clouds of their shapes."""

    train: list[AssemblyProgram]
    val: list[AssemblyProgram]
    train_clouds: FloatArray
    """(n, POINTS_PER_SHAPE, 3)"""
    val_clouds: FloatArray
    """(n, POINTS_PER_SHAPE, 3)"""
    real: FloatArray
    """(m, POINTS_PER_CLOUD, 3), of the first training shapes, for networks."""

    @cached_property
    def features(self) -> FloatArray | None:
        """Network features of `real`, as `features_of`."""
        return features_of(self.real)


def read_reference(run: DatasetRun, category: str, max_real: int) -> ReferencePrograms:
    """Read a category of the dataset. `max_real`: shapes for networks."""
    train, val = (read_category_programs(run, category, split) for split in ("train", "val"))
    train_boxes = boxes_of_programs(train)
    return ReferencePrograms(
        train,
        val,
        clouds_of(train_boxes),
        clouds_of(boxes_of_programs(val)),
        clouds_of(train_boxes[:max_real], POINTS_PER_CLOUD) if max_real else np.empty((0, POINTS_PER_CLOUD, 3)),
    )
