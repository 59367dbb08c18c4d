"""An example of a table outside the project."""

from __future__ import annotations

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Evaluation, NoOptions, TableResult
from eval.engine.requirements import FINISHED_DATASET
from eval.engine.shapes import split_shapes
from eval.engine.table import Table
from stages.shape.geometry.bounds import shape_bounds


def _compute(run: DatasetRun, _: NoOptions) -> TableResult:
    heights: dict[str, list[float]] = {}
    for kit, _split, _key, shape in split_shapes(run.folder):
        low, high = shape_bounds(shape)
        heights.setdefault(kit, []).append(float(high[1] - low[1]))
    rows = tuple((kit, len(of_kit), max(of_kit)) for kit, of_kit in heights.items())
    return TableResult([Table("Heights", ("shapes of", "shapes", "highest"), rows)])


TABLE = Evaluation("How high are the shapes?", (FINISHED_DATASET,), lambda run: 0.01 * run.samples, _compute)
