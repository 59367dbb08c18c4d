"""What a table is to `make eval`: a question, what must be there to answer it, how long that takes, and the answer."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from eval.engine.dataset_run import DatasetRun
from eval.engine.table import Table


@dataclass(frozen=True)
class Chart:
    """Lines in one plot. lines: points (x, y) by the name of each line, x ascending; across, up: what x and y are."""

    title: str
    across: str
    up: str
    lines: Mapping[str, Sequence[tuple[float, float]]]


@dataclass(frozen=True)
class ImageRow:
    """Pictures side by side: captions and PNGs."""

    title: str
    pictures: Sequence[tuple[str, bytes]]


@dataclass(frozen=True)
class Figure:
    """A picture as wide as the page, such as rows of shapes one below the other. name: of its file, in small letters;
    title: what it shows; picture: a PNG."""

    name: str
    title: str
    picture: bytes


@dataclass(frozen=True)
class TableResult:
    """tables: at least one, the first under the evaluation's own name; curves and strips for the pages alone; sheets
    for the pages, and as files beside them."""

    tables: Sequence[Table]
    curves: Sequence[Chart] = ()
    strips: Sequence[ImageRow] = ()
    sheets: Sequence[Figure] = ()


@dataclass(frozen=True)
class Requirement:
    """what: something that must be there, in a few words; missing: empty where it is there, else what is missing and
    what would make it, in words."""

    what: str
    missing: Callable[[DatasetRun], str]


def _no_options(_: ArgumentParser) -> None:
    return


@dataclass(frozen=True)
class Evaluation:
    """One table. `TABLE = Evaluation(...)` stands in `eval/tables/<name>.py`, and nowhere else.

    question: what it answers, a sentence; needs: asked in order, the first that is missing is told.
    seconds: about how long it takes on one core.
    answer: makes it, of a subject that has all it needs and of the options of the command line.
    of_files: makes it of files instead of a dataset, if it can; options: adds options of its own to the command line.
    """

    question: str
    needs: Sequence[Requirement]
    seconds: Callable[[DatasetRun], float]
    answer: Callable[[DatasetRun, Namespace], TableResult]
    of_files: Callable[[Sequence[Path], Namespace], TableResult] | None = None
    options: Callable[[ArgumentParser], None] = field(default=_no_options)

    def missing(self, subject: DatasetRun) -> str:
        """What keeps it from being made, or nothing."""
        return next((told for told in (need.missing(subject) for need in self.needs) if told), "")
