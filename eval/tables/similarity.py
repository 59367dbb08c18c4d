"""`make eval TABLE=similarity`: is each shape r-similar to its exemplars? (symmetry §3.1)"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pydantic import Field

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Evaluation, TableResult
from eval.engine.requirements import EXEMPLARS, FINISHED_DATASET
from pipeline.config import StrictModel
from stages.shape.arrays import FloatArray

MAX_SHAPES = 24


class SimilarityOptions(StrictModel):
    """What is compared."""

    max_shapes: int = Field(MAX_SHAPES, ge=1, description="shapes of the dataset")
    probes: int = Field(300, ge=1, description="random points of each shape")
    radius: float = Field(0.016, gt=0, lt=1, description="of a neighbourhood, in longest sides; the published value")


def _compute(run: DatasetRun, options: SimilarityOptions) -> TableResult:
    from eval.engine.shapes import dataset_shapes
    from eval.grammars.similarity import similarity_row, similarity_table, triangles_of
    from pipeline.randomness import decision_rng

    shapes: dict[str, list[FloatArray]] = {}
    for name, shape in dataset_shapes(run.folder, options.max_shapes):
        shapes.setdefault(name, []).append(triangles_of(shape))
    rows = []
    for name, exemplars in _exemplars(run).items():
        if name in shapes:
            rng = decision_rng(run.config.seed, "similarity", name)
            rows.append(similarity_row(name, exemplars, shapes[name], options.radius, options.probes, rng))
    return TableResult([similarity_table(rows)])


def _exemplars(run: DatasetRun) -> dict[str, list[FloatArray]]:
    """Return the triangles of the exemplars of each kit, and of the mesh of each grammar."""
    from eval.grammars.similarity import triangles_of
    from stages.exemplars.language import dataset_kits
    from stages.grammars.files import load_grammars
    from stages.shape.shape import kit_shape

    triangles = {
        name: [triangles_of(kit_shape(kit, exemplar.assembly)) for exemplar in kit.exemplars]
        for name, kit in dataset_kits(run.paths).items()
    }
    for name, grammar in load_grammars(run.paths).items():
        triangles[name] = [grammar.exemplar.vertices[grammar.exemplar.faces]]
    return triangles


def _compute_from_files(paths: Sequence[Path], options: SimilarityOptions, _: int) -> TableResult:
    from eval.engine.shapes import model_shapes
    from eval.grammars.similarity import similarity_row, similarity_table, triangles_of
    from pipeline.errors import ConfigError
    from pipeline.randomness import decision_rng

    if len(paths) < 2:
        raise ConfigError("similarity takes an exemplar and at least one shape after it")
    exemplar, *shapes = [(name, triangles_of(shape)) for path in paths for name, shape in model_shapes(path, "y")]
    rows = [
        similarity_row(
            name, [exemplar[1]], [triangles], options.radius, options.probes, decision_rng(0, "similarity", name)
        )
        for name, triangles in shapes
    ]
    return TableResult([similarity_table(rows)])


TABLE = Evaluation(
    question="Does every neighbourhood of a shape occur in an exemplar?",
    requirements=(FINISHED_DATASET, EXEMPLARS),
    estimate_seconds=lambda run: 20 + 4 * min(run.samples, MAX_SHAPES),
    compute=_compute,
    compute_from_files=_compute_from_files,
    options=SimilarityOptions,
)
