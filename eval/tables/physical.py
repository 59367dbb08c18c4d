"""`make eval TABLE=physical`: does it stand?"""

from __future__ import annotations

from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Chart, Evaluation, ImageRow, TableResult
from eval.engine.requirements import FINISHED_DATASET
from pipeline.errors import ConfigError
from stages.shape.shape import Shape

if TYPE_CHECKING:
    from eval.dataset.physical_validity import Judged

MOST = 200
SHOWN = 6
"""So many of the weakest shapes are drawn."""


def _options(parser: ArgumentParser) -> None:
    parser.add_argument("--most", type=_at_least(1), default=MOST, help="shapes of a dataset that are measured at most")
    parser.add_argument(
        "--dry", type=_at_least(0), default=10, help="shapes of a kind that are judged as dry blocks, too"
    )
    parser.add_argument("--up", choices=("y", "z"), default="y", help="the axis that points up in the files")


def _answer(subject: DatasetRun, asked: Namespace) -> TableResult:
    from eval.dataset.physical_validity import PUBLISHED, judged_by_name, physical_table
    from eval.engine.shapes import dataset_shapes
    from stages.shape.physics.settings import PhysicsConfig

    config = subject.config.section(PhysicsConfig)
    judged = judged_by_name(dataset_shapes(subject.folder, asked.most), config)
    table = physical_table(judged, config, asked.dry, PUBLISHED)
    return TableResult([table], [_margins(judged)], [ImageRow("The weakest, by the push they bear", _weakest(judged))])


def _of_files(paths: Sequence[Path], asked: Namespace) -> TableResult:
    from eval.dataset.physical_validity import PUBLISHED, judged_by_name, physical_table
    from eval.engine.shapes import box_shapes, model_shapes
    from stages.shape.physics.settings import PhysicsConfig

    def shapes() -> Iterator[tuple[str, Shape]]:
        for path in paths:
            if not path.is_file():
                raise ConfigError(f"there is no file {path}")
            yield from (box_shapes if path.suffix == ".npz" else model_shapes)(path, asked.up)

    boxes = [path.stem for path in paths if path.suffix == ".npz"]
    published = [each for each in PUBLISHED if any(each.name.partition(",")[0] in stem for stem in boxes)]
    config = PhysicsConfig()
    return TableResult([physical_table(judged_by_name(shapes(), config), config, asked.dry, published)])


def _margins(judged: Mapping[str, Judged]) -> Chart:
    """The share of shapes that bear a push of so many weights."""
    lines = {}
    for name, each in judged.items():
        margins = [validity.margin for validity in each.rigid]
        steps = sorted({0.0, *(margin for margin in margins if margin >= 0)})
        lines[name] = [(step, 100 * sum(margin >= step for margin in margins) / len(margins)) for step in steps]
    return Chart("How large a push they bear", "push, in weights", "% that bear it", lines)


def _weakest(judged: Mapping[str, Judged]) -> list[tuple[str, bytes]]:
    from eval.engine.pictures import shape_picture

    ranked = sorted(
        (validity.margin, name, place) for name, each in judged.items() for place, validity in enumerate(each.rigid)
    )
    pictures = []
    for margin, name, place in ranked[:SHOWN]:
        told = f"bears {margin:.2f}" if margin >= 0 else "does not stand"
        pictures.append((f"{name}, {told}", shape_picture(judged[name].shapes[place])))
    return pictures


def _at_least(least: int) -> Callable[[str], int]:
    """How an option reads a whole number."""

    def number(text: str) -> int:
        if int(text) < least:
            raise ArgumentTypeError(f"must be at least {least}")
        return int(text)

    return number


TABLE = Evaluation(
    question="Does what the dataset holds stand, and how large a push does it bear?",
    needs=(FINISHED_DATASET,),
    seconds=lambda subject: 10 + 0.2 * min(subject.samples, MOST),
    answer=_answer,
    of_files=_of_files,
    options=_options,
)
