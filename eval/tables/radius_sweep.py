"""`python -m eval radii a.glb`: what does the radius of similarity do to a grammar? (symmetry figure 10 j)"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from pathlib import Path

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Evaluation, Requirement, TableResult
from pipeline.errors import ConfigError

RADII = (0.008, 0.016, 0.032, 0.064)
FILE = "a model as a file: python -m eval radii a.glb"


def _options(parser: ArgumentParser) -> None:
    parser.add_argument("--radii", nargs="+", type=float, default=RADII, help="of similarity, in longest sides")


def _answer(subject: DatasetRun, asked: Namespace) -> TableResult:
    raise ConfigError(f"this table takes {FILE}")


def _of_files(paths: Sequence[Path], asked: Namespace) -> TableResult:
    from eval.grammars.radius_sweep import extractions, radii_sheet, radii_table
    from stages.grammars.settings import MAX_RADIUS_SHARE, MIN_RADIUS_SHARE

    for path in paths:
        if not path.is_file():
            raise ConfigError(f"there is no file {path}")
    for radius in asked.radii:
        if not MIN_RADIUS_SHARE <= radius <= MAX_RADIUS_SHARE:
            raise ConfigError(
                f"--radii: {radius:g} is not from {MIN_RADIUS_SHARE:g} to {MAX_RADIUS_SHARE:g} longest sides"
            )
    found = {path: extractions(path, sorted(asked.radii), asked.up) for path in paths}
    return TableResult(
        [radii_table(each) for each in found.values()], sheets=[radii_sheet(path, each) for path, each in found.items()]
    )


TABLE = Evaluation(
    question="What does the radius of similarity do to the grammar of a mesh?",
    needs=(Requirement("a model file", lambda subject: f"it takes {FILE}"),),  # a minute or two: no part of `all`
    seconds=lambda subject: 120.0,
    answer=_answer,
    of_files=_of_files,
    options=_options,
)
