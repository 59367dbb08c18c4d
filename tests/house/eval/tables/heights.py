"""A table of a house beside the project's."""

from __future__ import annotations

from argparse import Namespace

from eval.engine.dataset_run import Subject
from eval.engine.evaluation import Answer, Evaluation
from eval.engine.requirements import FINISHED
from eval.engine.shapes import split_shapes
from eval.engine.table import Table
from stages.shape.geometry.bounds import shape_bounds


def _answer(subject: Subject, _: Namespace) -> Answer:
    heights: dict[str, list[float]] = {}
    for kit, _split, _key, shape in split_shapes(subject.folder):
        low, high = shape_bounds(shape)
        heights.setdefault(kit, []).append(float(high[1] - low[1]))
    rows = tuple((kit, len(each), max(each)) for kit, each in heights.items())
    return Answer([Table("Heights", ("shapes of", "shapes", "highest"), rows)])


TABLE = Evaluation("How high are they?", (FINISHED,), lambda subject: 0.01 * subject.samples, _answer)
