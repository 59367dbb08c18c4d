"""Rows of the table of worth: a source, what a network learns from it, and how well it does on real shapes."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from eval.engine.table import Cell, Table
from eval.worth.categories import tells_categories
from eval.worth.learning import (
    FINE_TUNING_RATE,
    FIRST_RATE,
    precision_of_distance,
    precision_of_encoder,
    trained_encoder,
)
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


CATEGORY = "category"
"""Column of the share of categories that are told; the other columns are real sets."""

Results = Mapping[tuple[int, str], FloatArray]
"""Percent by number of labelled shapes and column, float64 (seeds, test shapes)."""


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
        for count in training.labelled:
            rate = FIRST_RATE if clouds is None else FINE_TUNING_RATE
            of_count = _results(encoder, tested, count, rate, training, repetition)
            if tested == sets:
                of_count |= _category_results(encoder, sets, count, training, repetition)
            for column, percents in of_count.items():
                results.setdefault((count, column), []).append(percents)
    stacked = {key: np.stack(precisions) for key, precisions in results.items()}
    return _tables(name, "" if clouds is None else len(clouds), stacked, sets, training.labelled)


def _results(
    encoder: PointEncoder, tested: Sequence[RealSet], count: int, rate: float, training: Training, repetition: int
) -> dict[str, FloatArray]:
    """Return the precision on each real set with as many labelled shapes, after learning from them."""
    results = {}
    for real in tested:
        test_clouds, labelled, _ = _read(real)
        if count <= len(labelled):
            rng = decision_rng(training.seed, "worth", "labelled", real.name, count, repetition)
            learnt = encoder
            if count:
                chosen = _drawn(labelled, count, rng)
                learnt = trained_encoder(encoder, chosen, training.labelled_steps, rng, learning_rate=rate)
            results[real.name] = precision_of_encoder(learnt, test_clouds)
    return results


def _category_results(
    encoder: PointEncoder, sets: Sequence[RealSet], count: int, training: Training, repetition: int
) -> dict[str, FloatArray]:
    """Return which categories are told after learning from `count` labelled shapes of each set, where there are two."""
    sets = [real for real in sets if real.category and count <= len(_read(real)[1])]
    if not count or len({real.category for real in sets}) < 2:
        return {}
    learnt, tested = [], []
    for real in sets:
        test_clouds, labelled, _ = _read(real)
        rng = decision_rng(training.seed, "worth", "labelled", real.name, count, repetition)
        learnt.append((real.category, _drawn(labelled, count, rng)))
        tested.append((real.category, test_clouds))
    return {CATEGORY: tells_categories(encoder, learnt, tested)}


def _drawn(labelled: LabelledClouds, count: int, rng: np.random.Generator) -> LabelledClouds:
    """Return `count` random labelled shapes, the same for all sources."""
    return labelled.chosen(rng.permutation(len(labelled))[:count])


@cache
def _read(real: RealSet) -> tuple[LabelledClouds, LabelledClouds, str]:
    return real.read()


def mean_and_interval(percents: FloatArray) -> tuple[float, float]:
    """Return the mean of float (seeds, shapes), and half of its 95 % interval over shapes and seeds."""
    of_shapes, of_seeds = percents.mean(axis=0), percents.mean(axis=1)
    variance = of_shapes.var(ddof=1) / len(of_shapes) if len(of_shapes) > 1 else 0.0
    if len(of_seeds) > 1:
        variance += of_seeds.var(ddof=1) / len(of_seeds)
    return float(percents.mean()), NORMAL_95 * float(np.sqrt(variance))


def _tables(name: str, shapes: Cell, results: Results, sets: Sequence[RealSet], labelled: Sequence[int]) -> list[Table]:
    """Return a table with the one row for each number of labelled shapes."""
    tables = []
    for count in labelled:
        columns: list[str] = ["learnt from", "shapes"]
        cells: list[Cell] = [name, shapes]
        categories = {real.category for real in sets if real.category}
        for column in [*(real.name for real in sets), *([CATEGORY] if count and len(categories) > 1 else [])]:
            percents = results.get((count, column))
            columns += [column, f"{column} ±"]
            cells += ["", ""] if percents is None else mean_and_interval(percents)
        title = f"{count} labelled real shapes" if count else "No labelled real shapes"
        tables.append(Table(title, tuple(columns), (tuple(cells),), _notes(sets)))
    return tables


def _notes(sets: Sequence[RealSet]) -> list[str]:
    note = (
        'Average precision, percent, of "these two points are of one part", for points nearer than '
        f"{MAX_PAIR_DISTANCE:g} of the diagonal: the mean of all test shapes and seeds. ±: half of the 95 % interval "
        "over shapes and seeds. distance of points: nearer pairs first, without a network. category: share of the test "
        "shapes whose category (chair, table, storage) a linear classifier tells from the network's description of the "
        "whole cloud; it learns from the labelled shapes, the network does not."
    )
    return [note, *(text for _, _, text in map(_read, sets) if text)]
