"""`make eval TABLE=decomposition`: are parts found again that were merged to one mesh? (symmetry)"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from pathlib import Path

from eval.evaluation import Answer, Evaluation
from eval.needs import KITS
from eval.subject import Subject
from pipeline.errors import ConfigError

__all__ = ["TABLE"]

CUTS = ("symmetry", "sections", "components")


def _options(parser: ArgumentParser) -> None:
    parser.add_argument("--cuts", nargs="+", choices=CUTS, default=["symmetry"], help="how merged models are cut")


def _answer(subject: Subject, asked: Namespace) -> Answer:
    from eval.decomposition import decomposition_table
    from stages.exemplars.language import made_kits
    from stages.shape.shape import kit_shape

    kits = made_kits(subject.places)
    shapes = [
        (f"{name}, {each.name}", kit_shape(kit, each.whole)) for name, kit in kits.items() for each in kit.exemplars
    ]
    return Answer([decomposition_table(shapes, asked.cuts)])


def _of_files(paths: Sequence[Path], asked: Namespace) -> Answer:
    from eval.decomposition import decomposition_table
    from eval.shapes import model_shapes

    for path in paths:
        if not path.is_file():
            raise ConfigError(f"there is no file {path}")
    return Answer([decomposition_table((each for path in paths for each in model_shapes(path, "y")), asked.cuts)])


def _seconds(subject: Subject) -> float:
    return 60.0 * len(list(subject.places.stage("exemplars").root.glob("*.json")))


TABLE = Evaluation(
    question="Are parts found again that were merged to one mesh?",
    needs=(KITS,),
    seconds=_seconds,
    answer=_answer,
    of_files=_of_files,
    options=_options,
)
