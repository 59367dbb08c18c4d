"""Trained models as tables see them: found by their kind, grouped over their seeds."""

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
Figures = TypeVar("Figures")


@dataclass(frozen=True)
class TrainedModel(Generic[Model]):
    """A trained model: what it is called in the config, its kit, its seed, and the model itself."""

    name: str
    kit: str
    seed: int
    model: Model

    @property
    def group(self) -> str:
        """Name of the models that differ by their seeds alone."""
        return f"{self.name}-{self.kit}"

    @property
    def folder(self) -> str:
        """Name of its folder among the published models."""
        return f"{self.group}-{self.seed}"


def trained_models(
    folder: Path,
    kind: str,
    load: Callable[[Path, Mapping[str, Any]], Model],
    kits: Container[str] | None = None,
) -> list[TrainedModel[Model]]:
    """The models of a kind in a folder of published models, by kit, name and seed, those of other kits than `kits` left
    out; `load` reads one, of its weights and what they say of themselves. Raises ConfigError for weights that are not
    what they should be."""
    found = []
    for path in weights_of_kind(folder, kind):
        try:
            header = read_header(path)
            if kits is not None and header.get("kit") not in kits:
                continue
            model = load(path, header)
        except CheckpointError as error:
            raise ConfigError(f"{error}; make train") from error
        name, seed = header["name"].split(f"-{header['kit']}-", 1)
        found.append(TrainedModel(name, header["kit"], int(seed), model))
    return sorted(found, key=lambda each: (each.kit, each.name, each.seed))


def training_curve(folder: Path, column: str) -> list[tuple[float, float]]:
    """Steps, and a figure of the training after so many, of a published model."""
    with open(folder / "curves.csv", newline="") as stream:
        return [(float(row["step"]), float(row[column])) for row in csv.DictReader(stream)]


def by_group(found: Iterable[tuple[TrainedModel[Any], Figures]]) -> dict[str, list[Figures]]:
    """Figures of models that stand beside each other where they differ by their seeds alone."""
    return {group: [each for _, each in of_group] for group, of_group in groupby(found, key=lambda each: each[0].group)}


def over_seeds(found: Sequence[Any], names: Sequence[str]) -> list[Cell]:
    """Means of some figures, with their standard deviation where there are several seeds."""
    cells: list[Cell] = []
    for name in names:
        values = [float(getattr(each, name)) for each in found]
        cells.append(f"{fmean(values):.1f} ± {stdev(values):.1f}" if len(values) > 1 else values[0])
    return cells
