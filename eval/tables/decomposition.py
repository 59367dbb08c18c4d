"""`python -m eval decomposition a.glb`: are parts found again that were merged to one mesh, and what may be exchanged?
(symmetry)"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from pathlib import Path

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Evaluation, Requirement, TableResult
from pipeline.errors import ConfigError

CUTS = ("symmetry", "sections", "components")
FILES = "models whose parts are known, as files: python -m eval decomposition a.glb b.glb"


def _options(parser: ArgumentParser) -> None:
    parser.add_argument("--cuts", nargs="+", choices=CUTS, default=["symmetry"], help="how merged models are cut")


def _answer(subject: DatasetRun, asked: Namespace) -> TableResult:
    raise ConfigError(f"this table takes {FILES}")


def _of_files(paths: Sequence[Path], asked: Namespace) -> TableResult:
    from eval.engine.shapes import model_kits
    from eval.grammars.decomposition import decomposition_table
    from eval.grammars.grammar_recall import grammar_table
    from stages.shape.shape import kit_shape

    for path in paths:
        if not path.is_file():
            raise ConfigError(f"there is no file {path}")
    kits = [each for path in paths for each in model_kits(path, "y")]
    shapes = [(name, kit_shape(kit, kit.exemplars[0].assembly)) for name, kit in kits]
    return TableResult([decomposition_table(shapes, asked.cuts), grammar_table(kits)])


TABLE = Evaluation(
    question="Are parts found again that were merged to one mesh, and what may be exchanged?",
    needs=(Requirement("model files", lambda subject: f"it takes {FILES}"),),  # a minute or two each: no part of `all`
    seconds=lambda subject: 120.0,
    answer=_answer,
    of_files=_of_files,
    options=_options,
)
