"""What the shapes that models write are compared with: the programs of a category, read and measured once for all its
models."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from eval.engine.dataset_run import DatasetRun
from eval.programs.models import category_programs
from eval.programs.quality import boxes_of_programs, clouds_of
from eval.programs.two_sample_test import POINTS, features_of
from stages.shape.arrays import FloatArray
from stages.shapeassembly.syntax.program import AssemblyProgram


@dataclass(frozen=True)
class Reference:
    """train, val: the programs; learnt, unseen: clouds (n, k, 3) of their shapes; shown: clouds (m, realism.POINTS, 3)
    of the first shapes of train, which networks look at."""

    train: list[AssemblyProgram]
    val: list[AssemblyProgram]
    learnt: FloatArray
    unseen: FloatArray
    shown: FloatArray

    @cached_property
    def features(self) -> FloatArray | None:
        """Of `shown`, as `features_of`."""
        return features_of(self.shown)


def read_reference(subject: DatasetRun, category: str, judged: int) -> Reference:
    """Of a category of the dataset; judged: how many shapes networks look at."""
    train, val = (category_programs(subject, category, split) for split in ("train", "val"))
    learnt = boxes_of_programs(train)
    return Reference(
        train,
        val,
        clouds_of(learnt),
        clouds_of(boxes_of_programs(val)),
        clouds_of(learnt[:judged], POINTS) if judged else np.empty((0, POINTS, 3)),
    )
