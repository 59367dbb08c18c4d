"""The plan of a sweep: how many shapes each split gets, and which shapes each shard may make.

A program of so few shapes that they can be listed gives each split some of its list. Of any other program each split
gets structures of its own, if there are enough; where there are not, shapes of one structure stand in all splits, and
the values of continuous parameters keep them apart.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, Literal

import numpy as np

from pipeline.errors import ConfigError
from pipeline.randomness import decision_rng
from stages.programs.draws import Interval, draw
from stages.programs.program import Program, find_program
from stages.programs.settings import RandomSamplingConfig
from stages.shape.arrays import FloatArray
from stages.shape.collection.assignment import SPLITS

MAX_LISTED_SHAPES = 4096
"""Shapes of a program are listed if its parameters have no more combinations."""
STRUCTURE_DRAWS = 4096
"""So many draws tell which structures a program has."""
MAX_STRUCTURES_CHECKED = 100
"""Of no more structures than this it is asked which of them any valid shape has."""

SplitBy = Literal["structure", "values"]


@dataclass(frozen=True)
class SplitPlan:
    """How a sweep is shared out.

    sizes: how many shapes of each split; existing: how many the program has in all, or None for more than are listed;
    apart: what keeps the splits apart, their structures or only the values of continuous parameters; structures: of
    each split the interval of its structures and their share of all draws.
    """

    sizes: dict[str, int]
    shape_count: int | None
    split_by: SplitBy
    structures: dict[str, tuple[Interval, float]] = field(default_factory=dict)

    def owned(self, split: str, start: int, end: int) -> dict[str, Any]:
        """The params of the shard of samples `start` to `end` of a split: which shapes it may make and no other."""
        total, size = sum(self.sizes.values()), self.sizes[split]
        before = sum(self.sizes[each] for each in SPLITS[: SPLITS.index(split)])
        if self.shape_count is not None:
            own = [self.shape_count * (before + each) // total for each in (start, end)]
            return {"listed": own, "apart": self.split_by}
        if self.split_by == "values":
            structures, weight, shapes = (0.0, 1.0), 1.0, ((before + start) / total, (before + end) / total)
        else:
            (structures, weight), shapes = self.structures[split], (start / size, end / size)
        return {"share": [structures, shapes], "weight": weight, "apart": self.split_by}

    def notes(self, config: RandomSamplingConfig, made: Mapping[str, int]) -> list[str]:
        """What people should know of a finished sweep that has `made` so many shapes of each split."""
        lines = []
        if self.shape_count is not None and self.shape_count < config.samples:
            lines.append(f"{config.samples:,} shapes were asked for, and the program has {self.shape_count:,} in all")
        if self.split_by == "values":
            lines.append("the program has fewer structures than splits: continuous values alone keep the splits apart")
        for split, size in self.sizes.items():
            if not made.get(split):
                lines.append(f"split {split} is empty: no shape is left for it")
            elif made[split] < size:
                lines.append(f"split {split} has {made[split]:,} shapes for {size:,}: no more were found")
        return lines


def plan_splits(program: str, config: RandomSamplingConfig) -> SplitPlan:
    """How a sweep of the program of this name is shared out. Raises ConfigError for one whose constraints leave it no
    shape."""
    shapes = _valid_shapes(program)
    if shapes is not None:
        existing = shapes.shape[1]
        if not existing:
            raise ConfigError(f"program {program}: no combination of its parameters keeps all its constraints")
        # Listed shapes differ in what is discrete: no two are of one structure.
        return SplitPlan(_sizes(min(config.samples, existing), config), existing, "structure")
    sizes = _sizes(config.samples, config)
    places, drawn = _structures(program)
    if len(places) < len(SPLITS):
        return SplitPlan(sizes, None, "values")
    counts = _sizes(len(places), config)
    ends = np.cumsum([counts[split] for split in SPLITS])[:-1]
    cuts = [0.0, *((places[ends - 1] + places[ends]) / 2).tolist(), 1.0]
    structures = {
        split: ((low, high), float(np.mean((drawn >= low) & (drawn < high))))
        for split, low, high in zip(SPLITS, cuts, cuts[1:], strict=False)
    }
    return SplitPlan(sizes, None, "structure", structures)


def listed_shapes(program: str, seed: int) -> FloatArray:
    """Every valid shape of a program of few shapes, in an order that `seed` decides, float64 (parameters, n)."""
    shapes = _valid_shapes(program)
    assert shapes is not None, f"{program} has too many shapes for a list"
    return shapes[:, decision_rng(seed, "programs", "listed").permutation(shapes.shape[1])]


def _sizes(total: int, config: RandomSamplingConfig) -> dict[str, int]:
    """How many of `total` each split gets: each at least one as long as they last, train first, then test."""
    test = min(max(round(config.test * total), 1), max(total - 1, 0))
    val = min(max(round(config.val * total), 1), max(total - 1 - test, 0))
    return {"train": total - val - test, "val": val, "test": test}


@lru_cache(maxsize=8)
def _valid_shapes(name: str) -> FloatArray | None:
    """The settled values of every valid shape, or None where there are too many combinations."""
    program = find_program(name)
    sizes = [len(each.values) for each in program.parameters]
    if any(each.kind == "continuous" for each in program.parameters) or math.prod(sizes) > MAX_LISTED_SHAPES:
        return None
    classes = np.indices(sizes).reshape(len(sizes), math.prod(sizes))
    columns = np.empty(classes.shape)
    for row, parameter, chosen in zip(columns, program.parameters, classes, strict=True):
        row[:] = np.array(parameter.values, dtype=np.float64)[chosen]
    settled, _ = program.schema.canonical_columns(columns)
    shapes = dict.fromkeys(tuple(column) for column in settled.T.tolist())
    valid = [shape for shape in shapes if _is_valid(program, np.array(shape))]
    return np.array(valid, dtype=np.float64).reshape(len(valid), len(sizes)).T


@lru_cache(maxsize=8)
def _structures(name: str) -> tuple[FloatArray, FloatArray]:
    """The places of the structures that random draws meet, ascending, and the place of each draw."""
    program = find_program(name)
    draws = draw(program.schema, STRUCTURE_DRAWS, decision_rng(0, "programs", "structures"), off_grid=True)
    drawn = draws.structure_places()
    places = np.unique(drawn)
    if len(places) <= MAX_STRUCTURES_CHECKED:
        valid = np.array([_is_valid(program, column) for column in draws.columns.T])
        places = np.unique(drawn[valid])
    return places, drawn


def _is_valid(program: Program, column: FloatArray) -> bool:
    return not program.violated(program.schema.from_vector(column))
