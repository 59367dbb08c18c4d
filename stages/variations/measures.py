"""Honest measures of a set of variants: how many differ, how far they are from the exemplars, how they spread."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from stages.variations.archive import cell_of
from stages.variations.features import AXES, MIXED
from stages.variations.settings import NoveltyConfig

__all__ = ["described", "growth", "pool_measures"]

QUANTILES = (0.0, 0.1, 0.5, 0.9, 1.0)


def pool_measures(
    counts: np.ndarray, features: np.ndarray, digests: np.ndarray, novelty: NoveltyConfig
) -> dict[str, Any]:
    """What a set of k variants is worth, as JSON.

    counts: int32 (k, types) parts by type; features: float32 (k, 9); digests: uint8 (k, 2, 32).
    graphs, histograms: distinct ones; mixed: share of variants with at least a tenth of their parts from other
    exemplars than the main one; blended: share with neighbourhoods of several exemplars that only one each shows;
    distance: mean, and distances: quantiles 0, 0.1, 0.5, 0.9 and 1, of the histogram metric E to the nearest exemplar
    (strings §5.3); parts: the same quantiles of the number of parts; cells: filled cells of the archive; bins: for
    each of its axes the filled steps.
    """
    cells = [cell_of(each, novelty.axes, novelty.resolution) for each in features]
    distances, parts = features[:, AXES.index("distance")], features[:, AXES.index("parts")]
    return {
        "graphs": len({bytes(each) for each in digests[:, 0]}),
        "histograms": len({bytes(each) for each in counts}),
        "mixed": _share(features[:, AXES.index("mixture")] >= MIXED),
        "blended": _share(features[:, AXES.index("blend")] > 0),
        "distance": round(float(distances.mean()), 4) if len(features) else 0.0,
        "distances": _quantiles(distances, 4),
        "parts": _quantiles(parts, 0),
        "cells": len(set(cells)),
        "bins": {axis: len(set(steps)) for axis, steps in zip(novelty.axes, zip(*cells, strict=True), strict=False)},
    }


def _share(holds: np.ndarray) -> float:
    return round(float(holds.mean()), 4) if len(holds) else 0.0


def described(measures: Mapping[str, Any]) -> str:
    """The measures of the variants chosen from a pool, in words."""
    low, _, median, _, high = measures["parts"] or [0] * 5
    return (
        f"chosen {measures['variants']:,} of {measures['pool']:,}: {measures['graphs']:,} distinct graphs, "
        f"{measures['histograms']:,} distinct histograms in {measures['cells']:,} cells; "
        f"{measures['mixed']:.0%} mix material of the exemplars, {measures['blended']:.0%} "
        f"their neighbourhoods; mean distance E to the nearest {measures['distance']:.2f}; "
        f"{low:.0f} to {high:.0f} parts, median {median:.0f}"
    )


def growth(curve: Sequence[Sequence[int]]) -> str:
    """A saturation curve, rows of tries, variants and histograms, at its quarters: how many after how many tries."""
    places = dict.fromkeys(-(-len(curve) * quarter // 4) - 1 for quarter in range(1, 5))
    points = [curve[place] for place in places if place >= 0]
    return ", ".join(f"{histograms:,} after {tries:,} tries" for tries, _, histograms in points)


def _quantiles(values: np.ndarray, digits: int) -> list[float]:
    """The values of the set that stand at its QUANTILES, none where it is empty."""
    if not len(values):
        return []
    return [round(float(each), digits) for each in np.quantile(values, QUANTILES, method="lower")]
