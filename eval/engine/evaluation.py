"""A table of `make eval`: the question it answers, its requirements, its options, and its result."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from eval.engine.dataset_run import DatasetRun
from eval.engine.table import Table
from pipeline.config import StrictModel


@dataclass(frozen=True)
class Chart:
    """Lines in one plot."""

    title: str
    x_label: str
    y_label: str
    lines: Mapping[str, Sequence[tuple[float, float]]]
    """Points (x, y) by the name of their line, x ascending."""


@dataclass(frozen=True)
class ImageRow:
    """Small pictures in a row: captions and PNGs."""

    title: str
    pictures: Sequence[tuple[str, bytes]]


@dataclass(frozen=True)
class Figure:
    """A picture as wide as the page, such as several rows of shapes."""

    name: str
    """In small letters; part of its file's name."""
    title: str
    png: bytes


@dataclass(frozen=True)
class TableResult:
    """What a table came to. The first table has the evaluation's name; figures are kept as files, too."""

    tables: Sequence[Table]
    charts: Sequence[Chart] = ()
    image_rows: Sequence[ImageRow] = ()
    figures: Sequence[Figure] = ()
    printed: str = ""
    """What a command printed, for results that a command made."""


@dataclass(frozen=True)
class Requirement:
    """What a table needs."""

    description: str
    missing: Callable[[DatasetRun], str]
    """What is missing and which command makes it; empty where nothing is missing."""


class NoOptions(StrictModel):
    """The options of a table without options."""


@dataclass(frozen=True)
class Evaluation:
    """One table: `TABLE = Evaluation(...)` in `eval/tables/<name>.py`."""

    question: str
    requirements: Sequence[Requirement]
    estimate_seconds: Callable[[DatasetRun], float]
    """On one core."""
    compute: Callable[[DatasetRun, Any], TableResult]
    """From a run that meets all requirements, and the options."""
    compute_from_files: Callable[[Sequence[Path], Any, int], TableResult] | None = None
    """From files instead of a dataset, the options, and the number of worker processes."""
    options: type[StrictModel] = NoOptions
    in_report: bool = True
    """Whether the report of all tables has it; a table that takes longer than the others together is made alone."""

    def missing(self, run: DatasetRun) -> str:
        """Return the first missing requirement, or an empty text."""
        return next((text for text in (need.missing(run) for need in self.requirements) if text), "")
