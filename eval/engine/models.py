"""Trained models in tables: found by kind, grouped over seeds."""

from __future__ import annotations

import csv
from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from statistics import fmean, stdev
from typing import Any, Generic, TypeVar

from eval.engine.table import Cell
from pipeline.errors import ConfigError
from stages.training.checkpoint import CheckpointError, read_header, weights_of_kind

Model = TypeVar("Model")
Result = TypeVar("Result")


@dataclass(frozen=True)
class TrainedModel(Generic[Model]):
    """A trained model of a kit."""

    name: str
    """In `training.models` of the config."""
    kit: str
    seed: int
    model: Model

    @property
    def group(self) -> str:
        """The name that models share if only their seeds differ."""
        return f"{self.name}-{self.kit}"

    @property
    def folder(self) -> str:
        """The name of its folder among the published models."""
        return f"{self.group}-{self.seed}"


def trained_models(
    folder: Path,
    kind: str,
    load: Callable[[Path, Mapping[str, Any]], Model],
    kits: Container[str] | None = None,
) -> list[TrainedModel[Model]]:
    """Load the models of a kind in a folder of published models, sorted by kit, name and seed.

    `load`: from the path of the weights and their header. `kits`: the kits whose models are loaded; None for all.
    Raises ConfigError for weights that cannot be read.
    """
    models = []
    for path in weights_of_kind(folder, kind):
        try:
            header = read_header(path)
            if kits is not None and header.get("kit") not in kits:
                continue
            model = load(path, header)
        except CheckpointError as error:
            raise ConfigError(f"{error}; make train") from error
        name, seed = header["name"].split(f"-{header['kit']}-", 1)
        models.append(TrainedModel(name, header["kit"], int(seed), model))
    return sorted(models, key=lambda trained: (trained.kit, trained.name, trained.seed))


def training_curve(folder: Path, column: str) -> list[tuple[float, float]]:
    """Return a column of a published model's training log, as (step, value)."""
    with open(folder / "curves.csv", newline="", encoding="utf-8") as stream:
        return [(float(row["step"]), float(row[column])) for row in csv.DictReader(stream)]


def by_group(results: Iterable[tuple[TrainedModel[Any], Result]]) -> dict[str, list[Result]]:
    """Group results of models over seeds; models of one group are adjacent."""
    groups = groupby(results, key=lambda pair: pair[0].group)
    return {group: [figures for _, figures in pairs] for group, pairs in groups}


def over_seeds(results: Sequence[Any], names: Sequence[str]) -> list[Cell]:
    """Return the means of some attributes, with standard deviations if there are several seeds."""
    cells: list[Cell] = []
    for name in names:
        values = [float(getattr(result, name)) for result in results]
        cells.append(f"{fmean(values):.1f} ± {stdev(values):.1f}" if len(values) > 1 else values[0])
    return cells
