"""`make eval TABLE=similarity`: is each shape r-similar to its exemplars? (symmetry §3.1)"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from pathlib import Path

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Evaluation, TableResult
from eval.engine.requirements import EXEMPLARS, FINISHED_DATASET
from stages.shape.arrays import FloatArray

MOST = 24
PROBES = 300
RADIUS = 0.016
"""As published, a share of the longest side."""


def _answer(subject: DatasetRun, asked: Namespace) -> TableResult:
    from eval.engine.shapes import dataset_shapes
    from eval.grammars.similarity import similarity_row, similarity_table, triangles_of
    from pipeline.randomness import decision_rng

    shapes: dict[str, list[FloatArray]] = {}
    for name, shape in dataset_shapes(subject.folder, asked.similar):
        shapes.setdefault(name, []).append(triangles_of(shape))
    rows = []
    for name, exemplars in _exemplars(subject).items():
        if name in shapes:
            rng = decision_rng(subject.config.seed, "similarity", name)
            rows.append(similarity_row(name, exemplars, shapes[name], asked.radius, asked.probes, rng))
    return TableResult([similarity_table(rows)])


def _exemplars(subject: DatasetRun) -> dict[str, list[FloatArray]]:
    """The triangles of the exemplars of each kit, and of the mesh of each grammar."""
    from eval.grammars.similarity import triangles_of
    from stages.exemplars.language import dataset_kits
    from stages.grammars.files import load_grammars
    from stages.shape.shape import kit_shape

    found = {
        name: [triangles_of(kit_shape(kit, each.assembly)) for each in kit.exemplars]
        for name, kit in dataset_kits(subject.paths).items()
    }
    for name, grammar in load_grammars(subject.paths).items():
        found[name] = [grammar.exemplar.vertices[grammar.exemplar.faces]]
    return found


def _of_files(paths: Sequence[Path], asked: Namespace) -> TableResult:
    from eval.engine.shapes import model_shapes
    from eval.grammars.similarity import similarity_row, similarity_table, triangles_of
    from pipeline.errors import ConfigError
    from pipeline.randomness import decision_rng

    if len(paths) < 2:
        raise ConfigError("similarity is asked of an exemplar and of shapes after it: two files at least")
    exemplar, *shapes = [(name, triangles_of(shape)) for path in paths for name, shape in model_shapes(path, "y")]
    rows = [
        similarity_row(name, [exemplar[1]], [each], asked.radius, asked.probes, decision_rng(0, "similarity", name))
        for name, each in shapes
    ]
    return TableResult([similarity_table(rows)])


def _options(parser: ArgumentParser) -> None:
    parser.add_argument("--similar", type=int, default=MOST, help="shapes of a dataset that are compared at most")
    parser.add_argument("--probes", type=int, default=PROBES, help="points of each that are looked at")
    parser.add_argument("--radius", type=float, default=RADIUS, help="of a neighbourhood, in longest sides")


TABLE = Evaluation(
    question="Does each shape look around every point as an exemplar does somewhere?",
    needs=(FINISHED_DATASET, EXEMPLARS),
    seconds=lambda subject: 20 + 4 * min(subject.samples, MOST),
    answer=_answer,
    of_files=_of_files,
    options=_options,
)
