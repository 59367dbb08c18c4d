"""Random shapes to train on, built while a model learns; none comes from a dataset.

The hash of a shape is in [0, 1) (`stages/programs/draws.py`). Training, validation and tests use disjoint intervals, so
they share no shape.
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

DRAWS_PER_BATCH = 64
"""The first valid draw of a batch is used."""
MAX_CONSECUTIVE_FAILURES = 100


@dataclass(frozen=True)
class RandomShape:
    """A shape of a program.

    values: canonical
    classes: int64 (parameters,), the hidden class for hidden parameters
    parts: the shape
    """

    values: dict[str, Value]
    classes: npt.NDArray[np.int64]
    parts: tuple[Part, ...]


def random_training_shapes(program: Program, interval: Interval, rng: np.random.Generator) -> Iterator[RandomShape]:
    """Yield valid shapes without end, each with one value of a visible parameter fixed and all others random.

    Every value of every parameter is fixed equally often (geocode §4). Shapes that the program fails to build are
    skipped. Raises BuildError after MAX_CONSECUTIVE_FAILURES of them.
    """
    schema, indices, share = program.schema, all_value_indices(program), Share(shapes=interval)
    rows = {name: row for row, name in enumerate(schema.by_name)}
    failures = 0
    while True:
        name, index = indices[int(rng.integers(len(indices)))]
        fixed = (name, float(schema.by_name[name].values[index]))
        draws = draw(schema, DRAWS_PER_BATCH, rng, off_grid=False, fixed=fixed)
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
                if failures == MAX_CONSECUTIVE_FAILURES:
                    raise
                continue
            failures = 0
            if intersecting_labels(program, parts) is None:
                yield RandomShape(values, schema.to_classes(values), parts)
                break


def nearest_valid_values(program: Program, values: Values) -> dict[str, Value]:
    """The nearest values that satisfy the program's constraints, or else its base."""
    valid = repair(program, values)
    return program.schema.canonical(program.schema.base)[0] if valid is None else valid
