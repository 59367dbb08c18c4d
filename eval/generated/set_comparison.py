"""The table that compares two sets of shapes, with two halves of the reference for scale."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from eval.engine.table import Table
from eval.generated.set_metrics import (
    CANDIDATES_PER_SET,
    JSD_CELLS,
    NOVELTY_PERCENTILE,
    jensen_shannon_divergence,
    nearest_by_chamfer,
    nearest_by_earth_movers,
    normalized_clouds,
    set_metrics,
    shape_descriptors,
)
from pipeline.display import ticking
from stages.shape.arrays import FloatArray

COLUMNS = (
    "sets",
    "shapes",
    "1-NNA CD %",
    "1-NNA EMD %",
    "COV CD %",
    "COV EMD %",
    "MMD CD x1e3",
    "MMD EMD x1e2",
    "JSD",
    "Fréchet",
    "novel %",
    "diversity x1e3",
)
MIN_HALVES = 4
"""Shapes of a reference that is compared with itself."""


def comparison_table(
    names: Sequence[str],
    sets: Sequence[FloatArray],
    normalize: bool,
    emd_points: int,
    workers: int = 1,
) -> Table:
    """Return one row for the generated set against the reference, and one for two halves of the reference.

    names, sets: generated, then reference; float64 (n, k, 3) and (m, k, 3), y up, at least two shapes each.
    """
    generated, reference = (normalized_clouds(clouds) if normalize else clouds for clouds in sets)
    rows = [(f"{names[0]} against {names[1]}", *_figures(generated, reference, emd_points, workers))]
    if len(reference) >= MIN_HALVES:
        order = np.random.default_rng(0).permutation(len(reference))
        halves = [reference[np.sort(half)] for half in np.array_split(order, 2)]
        rows.append((f"two halves of {names[1]}", *_figures(halves[0], halves[1], emd_points, workers)))
    points = sets[0].shape[1]
    scale = "Each cloud is centred and scaled to a sphere of radius 1." if normalize else "Sizes are kept."
    notes = (
        f"Clouds of {points:,} points, uniform by area. {scale} CD: squared distances, both directions summed. EMD: "
        f"optimal assignment of {emd_points} points. Nearest shapes are the best of {CANDIDATES_PER_SET} candidates. "
        "Both sets have the size of the smaller.",
        "1-NNA: 50 means that the sets cannot be told apart, 100 that they are separate, 0 that they are copies; fewer "
        "than 100 shapes say little. COV: share of reference "
        f"shapes that are nearest to a generated one. JSD: bits, {JSD_CELLS}³ cells. Fréchet: of distances within a "
        "shape and of heights, not of a network. Novel: farther from the reference than "
        f"{NOVELTY_PERCENTILE:g} % of it from each other.",
    )
    return Table("Sets of shapes compared", COLUMNS, tuple(rows), notes)


def _figures(
    generated: FloatArray, reference: FloatArray, emd_points: int, workers: int
) -> tuple[str | int | float, ...]:
    from eval.programs.two_sample_test import frechet_distance

    count = min(len(generated), len(reference))
    generated, reference = _subset(generated, count), _subset(reference, count)
    with ticking("eval", f"comparing {count} and {count} shapes by CD"):
        of_generated, of_reference, diversity = nearest_by_chamfer(generated, reference, workers)
    with ticking("eval", f"comparing {count} and {count} shapes by EMD"):
        by_emd = nearest_by_earth_movers(generated[:, :emd_points], reference[:, :emd_points], workers)
    chamfer, emd = set_metrics(of_generated, of_reference), set_metrics(*by_emd)
    return (
        count,
        chamfer.one_nna,
        emd.one_nna,
        chamfer.coverage,
        emd.coverage,
        1e3 * chamfer.matching_distance,
        1e2 * emd.matching_distance,
        jensen_shannon_divergence(generated, reference),
        frechet_distance(shape_descriptors(generated), shape_descriptors(reference)),
        chamfer.novelty,
        1e3 * diversity,
    )


def _subset(clouds: FloatArray, count: int) -> FloatArray:
    chosen: FloatArray = clouds[np.sort(np.random.default_rng(0).permutation(len(clouds))[:count])]
    return chosen
