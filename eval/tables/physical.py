"""`make eval TABLE=physical`: are the shapes physically stable?"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Chart, Evaluation, ImageRow, TableResult
from eval.engine.requirements import FINISHED_DATASET
from pipeline.config import StrictModel
from pipeline.errors import ConfigError
from stages.shape.shape import Shape

if TYPE_CHECKING:
    from eval.dataset.physical_validity import PhysicalResults

MAX_SHAPES = 200
SHAPES_SHOWN = 6


class PhysicalOptions(StrictModel):
    """How many shapes are judged, and how."""

    max_shapes: int = Field(MAX_SHAPES, ge=1, description="shapes of the dataset that are judged")
    dry_shapes: int = Field(10, ge=0, description="shapes of each kind that are also judged as dry blocks")
    up: Literal["y", "z"] = Field("y", description="the axis that points up in files")


def _compute(run: DatasetRun, options: PhysicalOptions) -> TableResult:
    from eval.dataset.physical_validity import PUBLISHED, judge_by_name, physical_table
    from eval.engine.shapes import dataset_shapes
    from stages.shape.physics.settings import PhysicsConfig

    config = run.config.section(PhysicsConfig)
    results = judge_by_name(dataset_shapes(run.folder, options.max_shapes), config)
    table = physical_table(results, config, options.dry_shapes, PUBLISHED)
    weakest = ImageRow("The weakest shapes, by the push that they bear", _weakest(results))
    return TableResult([table], [_margins(results)], [weakest])


def _compute_from_files(paths: Sequence[Path], options: PhysicalOptions, _: int) -> TableResult:
    from eval.dataset.physical_validity import PUBLISHED, judge_by_name, physical_table
    from eval.engine.shapes import box_shapes, model_shapes
    from stages.shape.physics.settings import PhysicsConfig

    def shapes() -> Iterator[tuple[str, Shape]]:
        for path in paths:
            if not path.is_file():
                raise ConfigError(f"there is no file {path}")
            yield from (box_shapes if path.suffix == ".npz" else model_shapes)(path, options.up)

    boxes = [path.stem for path in paths if path.suffix == ".npz"]
    published = [row for row in PUBLISHED if any(row.name.partition(",")[0] in stem for stem in boxes)]
    config = PhysicsConfig()
    return TableResult([physical_table(judge_by_name(shapes(), config), config, options.dry_shapes, published)])


def _margins(results: Mapping[str, PhysicalResults]) -> Chart:
    lines = {}
    for name, result in results.items():
        margins = [validity.margin for validity in result.rigid]
        pushes = sorted({0.0, *(margin for margin in margins if margin >= 0)})
        lines[name] = [(push, 100 * sum(margin >= push for margin in margins) / len(margins)) for push in pushes]
    return Chart("Stability under a push", "push, in weights", "% of shapes that bear it", lines)


def _weakest(results: Mapping[str, PhysicalResults]) -> list[tuple[str, bytes]]:
    from eval.engine.pictures import rendered_png

    ranked = sorted(
        (validity.margin, name, index)
        for name, result in results.items()
        for index, validity in enumerate(result.rigid)
    )
    pictures = []
    for margin, name, index in ranked[:SHAPES_SHOWN]:
        verdict = f"bears {margin:.2f}" if margin >= 0 else "falls"
        pictures.append((f"{name}, {verdict}", rendered_png(results[name].shapes[index])))
    return pictures


TABLE = Evaluation(
    question="Are the shapes physically stable, and how large a push do they bear?",
    requirements=(FINISHED_DATASET,),
    estimate_seconds=lambda run: 10 + 0.2 * min(run.samples, MAX_SHAPES),
    compute=_compute,
    compute_from_files=_compute_from_files,
    options=PhysicalOptions,
)
