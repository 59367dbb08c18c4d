"""The split plan of random sampling: how many shapes each split gets, and which shapes each shard may make.

A program with few shapes divides a list of them. Otherwise each split gets structures of its own if there are enough.
If not, all splits have all structures, and differ in the values of continuous parameters.
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
STRUCTURE_DRAWS = 4096
"""Random draws that show the structures of a program."""
MAX_STRUCTURES_CHECKED = 100
"""With more structures, those without a valid shape are not removed."""

SplitBy = Literal["structure", "values"]


@dataclass(frozen=True)
class SplitPlan:
    """How random shapes are divided.

    sizes: number of shapes of each split
    shape_count: number of all shapes of the program; None for too many to list
    split_by: how the splits differ, in their structures or only in the values of continuous parameters
    structures: of each split, the interval of its structures' hashes and their share of all draws
    """

    sizes: dict[str, int]
    shape_count: int | None
    split_by: SplitBy
    structures: dict[str, tuple[Interval, float]] = field(default_factory=dict)

    def owned(self, split: str, start: int, end: int) -> dict[str, Any]:
        """The params of the shard of samples `start` to `end` of a split: the shapes that it alone may make."""
        total, size = sum(self.sizes.values()), self.sizes[split]
        before = sum(self.sizes[earlier] for earlier in SPLITS[: SPLITS.index(split)])
        if self.shape_count is not None:
            bounds = [self.shape_count * (before + bound) // total for bound in (start, end)]
            return {"listed": bounds, "split_by": self.split_by}
        if self.split_by == "values":
            structures, weight, shapes = (0.0, 1.0), 1.0, ((before + start) / total, (before + end) / total)
        else:
            (structures, weight), shapes = self.structures[split], (start / size, end / size)
        return {"share": [structures, shapes], "weight": weight, "split_by": self.split_by}

    def notes(self, config: RandomSamplingConfig, made: Mapping[str, int]) -> list[str]:
        """Notes for people about finished sampling; made: number of shapes of each split."""
        lines = []
        if self.shape_count is not None and self.shape_count < config.samples:
            lines.append(f"{config.samples:,} shapes were requested, but the program has only {self.shape_count:,}")
        if self.split_by == "values":
            lines.append("the program has fewer structures than splits: the splits differ in continuous values alone")
        for split, size in self.sizes.items():
            if not made.get(split):
                lines.append(f"split {split} is empty: no shape is left for it")
            elif made[split] < size:
                lines.append(f"split {split} has {made[split]:,} shapes for {size:,}: no more were found")
        return lines


def plan_splits(program: str, config: RandomSamplingConfig) -> SplitPlan:
    """Plan the splits of a program, by its name. Raises ConfigError where its constraints admit no shape."""
    shapes = _valid_shapes(program)
    if shapes is not None:
        existing = shapes.shape[1]
        if not existing:
            raise ConfigError(f"program {program}: no combination of its parameters satisfies all its constraints")
        # Listed shapes have no continuous parameters, so no two have the same structure.
        return SplitPlan(_sizes(min(config.samples, existing), config), existing, "structure")
    sizes = _sizes(config.samples, config)
    hashes, draw_hashes = _structures(program)
    if len(hashes) < len(SPLITS):
        return SplitPlan(sizes, None, "values")
    counts = _sizes(len(hashes), config)
    ends = np.cumsum([counts[split] for split in SPLITS])[:-1]
    cuts = [0.0, *((hashes[ends - 1] + hashes[ends]) / 2).tolist(), 1.0]
    structures = {
        split: ((low, high), float(np.mean((draw_hashes >= low) & (draw_hashes < high))))
        for split, low, high in zip(SPLITS, cuts, cuts[1:], strict=False)
    }
    return SplitPlan(sizes, None, "structure", structures)


def listed_shapes(program: str, seed: int) -> FloatArray:
    """List every valid shape of a program with few, shuffled by `seed`, float64 (parameters, n)."""
    shapes = _valid_shapes(program)
    assert shapes is not None, f"{program} has too many shapes to list"
    return shapes[:, decision_rng(seed, "programs", "listed").permutation(shapes.shape[1])]


def _sizes(total: int, config: RandomSamplingConfig) -> dict[str, int]:
    """Divide `total` among the splits: at least one each while they last, train first, then test."""
    test = min(max(round(config.test * total), 1), max(total - 1, 0))
    val = min(max(round(config.val * total), 1), max(total - 1 - test, 0))
    return {"train": total - val - test, "val": val, "test": test}


@lru_cache(maxsize=8)
def _valid_shapes(name: str) -> FloatArray | None:
    """The canonical values of every valid shape, or None where there are too many combinations."""
    program = find_program(name)
    sizes = [len(parameter.values) for parameter in program.parameters]
    if any(parameter.kind == "continuous" for parameter in program.parameters) or math.prod(sizes) > MAX_LISTED_SHAPES:
        return None
    classes = np.indices(sizes).reshape(len(sizes), math.prod(sizes))
    columns = np.empty(classes.shape)
    for row, parameter, indices in zip(columns, program.parameters, classes, strict=True):
        row[:] = np.array(parameter.values, dtype=np.float64)[indices]
    canonical, _ = program.schema.canonical_columns(columns)
    shapes = dict.fromkeys(tuple(column) for column in canonical.T.tolist())
    valid = [shape for shape in shapes if _is_valid(program, np.array(shape))]
    return np.array(valid, dtype=np.float64).reshape(len(valid), len(sizes)).T


@lru_cache(maxsize=8)
def _structures(name: str) -> tuple[FloatArray, FloatArray]:
    """The hashes of the structures among random draws, ascending, and the hash of each draw."""
    program = find_program(name)
    draws = draw(program.schema, STRUCTURE_DRAWS, decision_rng(0, "programs", "structures"), off_grid=True)
    draw_hashes = draws.structure_hashes()
    hashes = np.unique(draw_hashes)
    if len(hashes) <= MAX_STRUCTURES_CHECKED:
        valid = np.array([_is_valid(program, column) for column in draws.columns.T])
        hashes = np.unique(draw_hashes[valid])
    return hashes, draw_hashes


def _is_valid(program: Program, column: FloatArray) -> bool:
    return not program.violated(program.schema.from_vector(column))
