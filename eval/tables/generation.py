"""`make eval TABLE=generation`: how near is one set of shapes to another?"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Evaluation, TableResult
from eval.engine.requirements import FINISHED_DATASET
from pipeline.config import StrictModel

if TYPE_CHECKING:
    from stages.shape.arrays import FloatArray

MAX_SHAPES = 500


class GenerationOptions(StrictModel):
    """Which sets are compared, and how."""

    generated: str = Field("test", description="a split, exemplars, or a folder of models or a dataset, or an .npy")
    reference: str = Field("train", description="the set it is compared with, given in the same way")
    kit: str = Field("", description="only shapes of this kit of the dataset; empty for all")
    max_shapes: int = Field(MAX_SHAPES, ge=2, le=5000, description="shapes of a set; others are left out at random")
    points: int = Field(2048, ge=64, le=10_000, description="points of a cloud, uniform by area")
    emd_points: int = Field(256, ge=16, le=2048, description="points of a cloud that are compared by EMD")
    normalize: Literal["shape", "none"] = Field(
        "shape", description="shape: each cloud is centred and scaled to a sphere of radius 1; none: sizes count"
    )


def _compute(run: DatasetRun, options: GenerationOptions) -> TableResult:
    from eval.generated.shape_sets import clouds_of_set

    names = (options.generated, options.reference)
    sets = [clouds_of_set(name, run, options.kit, options.max_shapes, options.points) for name in names]
    return _compared(names, sets, options, run.workers)


def _compute_from_files(paths: Sequence[Path], options: GenerationOptions, workers: int) -> TableResult:
    from eval.generated.shape_sets import clouds_of_path
    from pipeline.errors import ConfigError

    if len(paths) != 2:
        raise ConfigError(f"generation compares two sets, such as generated/ and reference/; got {len(paths)}")
    sets = [clouds_of_path(path, options.max_shapes, options.points) for path in paths]
    return _compared([path.name for path in paths], sets, options, workers)


def _compared(
    names: Sequence[str], sets: Sequence[FloatArray], options: GenerationOptions, workers: int
) -> TableResult:
    from eval.generated.set_comparison import comparison_table

    table = comparison_table(
        names,
        sets,
        normalize=options.normalize == "shape",
        emd_points=options.emd_points,
        workers=workers,
    )
    return TableResult([table])


TABLE = Evaluation(
    question="How near is one set of shapes to another: generated to real, val to train, a dataset to its exemplars?",
    requirements=(FINISHED_DATASET,),
    estimate_seconds=lambda run: 10 + 0.4 * min(run.samples, 2 * MAX_SHAPES),
    compute=_compute,
    compute_from_files=_compute_from_files,
    options=GenerationOptions,
)
