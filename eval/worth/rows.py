"""Rows of the table of worth: a source, what a network learns from it, and how well it does on real shapes."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import count as counted_from

import numpy as np

from eval.engine.table import Cell, Table
from eval.worth.categories import category_hits
from eval.worth.learning import (
    FINE_TUNING_LEARNING_RATE,
    FIRST_LEARNING_RATE,
    precision_of_distance,
    precision_of_encoder,
    trained_encoder,
)
from eval.worth.real_sets import RealSet
from pipeline.display import counting, ticking
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
"""Column of the share of categories that a linear probe finds; the other columns are real sets."""

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
    with ticking("worth", "reading real shapes"):
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
    with ticking("worth", f"reading {name}"):
        clouds = None if read is None else read()
        for real in sets:
            _read(real)
    results: dict[tuple[int, str], list[FloatArray]] = {}
    with counting("worth", _steps(clouds, tested, training), f"steps, {name}") as show:
        steps = counted_from(1)
        for repetition in range(training.repetitions):
            learner = _Learner(training, repetition, clouds is not None, lambda: show(next(steps)))
            encoder = learner.first_encoder(name, clouds)
            for labelled in training.labelled:
                percents = learner.precision_by_set(encoder, tested, labelled)
                if tested == sets:  # a network that saw real furniture has seen categories
                    percents |= learner.category_results(encoder, sets, labelled)
                for column, of_shapes in percents.items():
                    results.setdefault((labelled, column), []).append(of_shapes)
    stacked = {key: np.stack(percents) for key, percents in results.items()}
    return _tables(name, "" if clouds is None else len(clouds), stacked, sets, training.labelled)


def _steps(clouds: LabelledClouds | None, tested: Sequence[RealSet], training: Training) -> int:
    """Return the optimiser steps of a row."""
    tuned = sum(0 < labelled <= len(_read(real)[1]) for labelled in training.labelled for real in tested)
    return training.repetitions * ((0 if clouds is None else training.steps) + tuned * training.labelled_steps)


@dataclass(frozen=True)
class _Learner:
    """One repetition of a row.

    is_pretrained: whether encoders have learnt from clouds before labelled shapes come.
    on_step: called after each optimiser step.
    """

    training: Training
    repetition: int
    is_pretrained: bool
    on_step: Callable[[], None]

    def first_encoder(self, name: str, clouds: LabelledClouds | None) -> PointEncoder:
        """Return an encoder of random weights, after learning from the clouds if there are any."""
        seed = decision_rng(self.training.seed, "worth", "weights", self.repetition).integers(2**31)
        encoder = new_model(int(seed)).eval()
        if clouds is None:
            return encoder
        rng = decision_rng(self.training.seed, "worth", "training", name, self.repetition)
        ways = self.training.ways
        return trained_encoder(encoder, clouds, self.training.steps, rng, ways, on_step=self.on_step)

    def precision_by_set(
        self, encoder: PointEncoder, tested: Sequence[RealSet], labelled: int
    ) -> dict[str, FloatArray]:
        """Return the precision on each real set with as many labelled shapes, after learning from them."""
        rate = FINE_TUNING_LEARNING_RATE if self.is_pretrained else FIRST_LEARNING_RATE
        steps, percents = self.training.labelled_steps, {}
        for real in tested:
            if labelled <= len(_read(real)[1]):
                learnt = encoder
                if labelled:
                    chosen, rng = self._labelled_clouds(real, labelled)
                    learnt = trained_encoder(encoder, chosen, steps, rng, (), rate, self.on_step)
                percents[real.name] = precision_of_encoder(learnt, _read(real)[0])
        return percents

    def category_results(self, encoder: PointEncoder, sets: Sequence[RealSet], labelled: int) -> dict[str, FloatArray]:
        """Return which categories a linear probe finds that learns from labelled shapes, if there are two."""
        sets = [real for real in sets if real.category and labelled <= len(_read(real)[1])]
        if not labelled or len({real.category for real in sets}) < 2:
            return {}
        known = [(real.category, self._labelled_clouds(real, labelled)[0]) for real in sets]
        return {CATEGORY: category_hits(encoder, known, [(real.category, _read(real)[0]) for real in sets])}

    def _labelled_clouds(self, real: RealSet, labelled: int) -> tuple[LabelledClouds, np.random.Generator]:
        """Return random labelled shapes of a set, the same for all sources, and the generator that drew them."""
        rng = decision_rng(self.training.seed, "worth", "labelled", real.name, labelled, self.repetition)
        clouds = _read(real)[1]
        return clouds.chosen(rng.permutation(len(clouds))[:labelled]), rng


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
        "shapes whose category (chair, table, storage) a linear probe finds from the network's description of the "
        "cloud; the probe learns from the labelled shapes, the network does not."
    )
    return [note, *(text for _, _, text in map(_read, sets) if text)]
