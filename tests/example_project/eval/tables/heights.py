"""A table of a house beside the project's."""

from __future__ import annotations

from argparse import Namespace

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Evaluation, TableResult
from eval.engine.requirements import FINISHED_DATASET
from eval.engine.shapes import split_shapes
from eval.engine.table import Table
from stages.shape.geometry.bounds import shape_bounds


def _answer(subject: DatasetRun, _: Namespace) -> TableResult:
    heights: dict[str, list[float]] = {}
    for kit, _split, _key, shape in split_shapes(subject.folder):
        low, high = shape_bounds(shape)
        heights.setdefault(kit, []).append(float(high[1] - low[1]))
    rows = tuple((kit, len(each), max(each)) for kit, each in heights.items())
    return TableResult([Table("Heights", ("shapes of", "shapes", "highest"), rows)])


TABLE = Evaluation("How high are they?", (FINISHED_DATASET,), lambda subject: 0.01 * subject.samples, _answer)
