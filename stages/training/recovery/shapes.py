"""Shapes to learn from, made while a model learns: there is no end of them, and none comes from a dataset.

Every shape of a program has a place in [0, 1) (`stages/programs/draws.py`). What is learnt from, what a training is
judged by and what tables are made of lie in intervals that do not meet, so no shape stands in two of them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stages.programs.curves.part import Part
from stages.programs.draws import Interval, Share, draw
from stages.programs.intersection import intersecting_labels
from stages.programs.parameters import Value
from stages.programs.program import BuildError, Program
from stages.programs.repair import repair
from stages.programs.sampling import all_value_indices
from stages.programs.schema import Values

TRAIN_INTERVAL: Interval = (0.0, 0.8)
VALIDATION_INTERVAL: Interval = (0.8, 0.9)
TEST_INTERVAL: Interval = (0.9, 1.0)

AT_ONCE = 64
"""Draws at a time, of which the first that is valid is taken."""
FAILURES = 100


@dataclass(frozen=True)
class RandomShape:
    """values: settled; classes: int64 (parameters,), the hidden class where a parameter is hidden; parts: the shape."""

    values: dict[str, Value]
    classes: npt.NDArray[np.int64]
    parts: tuple[Part, ...]


def random_shapes(program: Program, interval: Interval, rng: np.random.Generator) -> Iterator[RandomShape]:
    """Valid shapes without end, each with one value of one parameter that is visible, all others random: every value
    of every parameter is fixed as often (geocode §4). Where the program fails, the next is taken.

    Raises BuildError where it fails FAILURES times without a shape between."""
    schema, every, share = program.schema, all_value_indices(program), Share(shapes=interval)
    rows = {name: row for row, name in enumerate(schema.by_name)}
    failures = 0
    while True:
        name, value = every[int(rng.integers(len(every)))]
        fixed = (name, float(schema.by_name[name].values[value]))
        draws = draw(schema, AT_ONCE, rng, off_grid=False, fixed=fixed)
        for column in draws.owned(share).tolist():
            if not draws.visible[rows[name], column]:
                continue
            values = schema.from_vector(draws.columns[:, column])
            if program.violated(values):
                continue
            try:
                parts = tuple(program.parts(values))
            except BuildError:
                failures += 1
                if failures == FAILURES:
                    raise
                continue
            failures = 0
            if intersecting_labels(program, parts) is None:
                yield RandomShape(values, schema.to_classes(values), parts)
                break


def nearest_valid_values(program: Program, values: Values) -> dict[str, Value]:
    """The nearest values that keep the program's constraints, or, where there are none, its base."""
    found = repair(program, values)
    return program.schema.canonical(program.schema.base)[0] if found is None else found
