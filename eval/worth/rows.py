"""Rows of the table of worth: a source, what a network learns from it, and its precision on real shapes."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from eval.engine.table import Cell, Table
from eval.worth.learning import precision_of_distance, precision_of_encoder, trained_encoder
from eval.worth.real_sets import RealSet
from pipeline.randomness import decision_rng
from stages.shape.arrays import FloatArray
from stages.training.loop import set_deterministic
from stages.training.point_encoder.clouds import LabelledClouds
from stages.training.point_encoder.network import MAX_PAIR_DISTANCE, PointEncoder
from stages.training.point_encoder.settings import Augmentation
from stages.training.point_encoder.training import new_model

NORMAL_95 = 1.96
"""Standard deviations of a normal distribution to each side that hold 95 %."""


Results = Mapping[tuple[int, str], FloatArray]
"""Average precision by number of labelled shapes and name of the real set, float64 (seeds, test shapes)."""


@dataclass(frozen=True)
class Training:
    """How long networks learn, how often, and with which augmentation.

    labelled: numbers of labelled real shapes to learn from after pre-training, for `labelled_steps` steps each.
    repetitions: trainings from different weights.
    """

    steps: int
    labelled: tuple[int, ...]
    labelled_steps: int
    repetitions: int
    ways: Collection[Augmentation]
    seed: int


def distance_tables(sets: Sequence[RealSet]) -> list[Table]:
    """Return the row of the distance of points, without network and labelled shapes."""
    results = {(0, real.name): precision_of_distance(_read(real)[0])[None] for real in sets}
    return _tables("distance of points", "", results, sets, (0,))


def network_tables(
    name: str,
    read: Callable[[], LabelledClouds] | None,
    tested: Sequence[RealSet],
    sets: Sequence[RealSet],
    training: Training,
) -> list[Table]:
    """Return the row of networks that learn from clouds, in one table for each number of labelled shapes.

    name: of the source of the clouds; it decides the random streams.
    read: returns the clouds; None for random weights.
    tested: those of the real sets that the row has values for.
    """
    set_deterministic(1)
    clouds = None if read is None else read()
    results: dict[tuple[int, str], list[FloatArray]] = {}
    for repetition in range(training.repetitions):
        encoder = new_model(int(decision_rng(training.seed, "worth", "weights", repetition).integers(2**31)))
        if clouds is not None:
            rng = decision_rng(training.seed, "worth", "training", name, repetition)
            encoder = trained_encoder(encoder, clouds, training.steps, rng, training.ways)
        for real in tested:
            test_clouds, labelled, _ = _read(real)
            for count in training.labelled:
                if count <= len(labelled):
                    learnt = _learnt(encoder, real.name, labelled, count, training, repetition)
                    results.setdefault((count, real.name), []).append(precision_of_encoder(learnt, test_clouds))
    stacked = {key: np.stack(precisions) for key, precisions in results.items()}
    return _tables(name, "" if clouds is None else len(clouds), stacked, sets, training.labelled)


def _learnt(
    encoder: PointEncoder, name: str, labelled: LabelledClouds, count: int, training: Training, repetition: int
) -> PointEncoder:
    """Return the encoder after learning from `count` random labelled shapes, the same for all sources."""
    if not count:
        return encoder
    rng = decision_rng(training.seed, "worth", "labelled", name, count, repetition)
    chosen = labelled.chosen(rng.permutation(len(labelled))[:count])
    return trained_encoder(encoder, chosen, training.labelled_steps, rng)


@cache
def _read(real: RealSet) -> tuple[LabelledClouds, LabelledClouds, str]:
    return real.read()


def mean_and_interval(precisions: FloatArray) -> tuple[float, float]:
    """Return the mean of float (seeds, shapes), and half of its 95 % interval over shapes and seeds."""
    of_shapes, of_seeds = precisions.mean(axis=0), precisions.mean(axis=1)
    variance = of_shapes.var(ddof=1) / len(of_shapes) if len(of_shapes) > 1 else 0.0
    if len(of_seeds) > 1:
        variance += of_seeds.var(ddof=1) / len(of_seeds)
    return float(precisions.mean()), NORMAL_95 * float(np.sqrt(variance))


def _tables(name: str, shapes: Cell, results: Results, sets: Sequence[RealSet], labelled: Sequence[int]) -> list[Table]:
    """Return a table with the one row for each number of labelled shapes."""
    tables = []
    for count in labelled:
        columns: list[str] = ["learnt from", "shapes"]
        cells: list[Cell] = [name, shapes]
        for real in sets:
            precisions = results.get((count, real.name))
            columns += [real.name, f"{real.name} ±"]
            cells += ["", ""] if precisions is None else mean_and_interval(precisions)
        title = f"{count} labelled real shapes" if count else "No labelled real shapes"
        tables.append(Table(title, tuple(columns), (tuple(cells),), _notes(sets)))
    return tables


def _notes(sets: Sequence[RealSet]) -> list[str]:
    note = (
        'Average precision, percent, of "these two points are of one part", for points nearer than '
        f"{MAX_PAIR_DISTANCE:g} of the diagonal: the mean of all test shapes and seeds. ±: half of the 95 % interval "
        "over shapes and seeds. distance of points: nearer pairs first, without a network."
    )
    return [note, *(text for _, _, text in map(_read, sets) if text)]
