"""Measures of a set of variants: how many differ, how far they are from the exemplars, how varied they are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from stages.shape.arrays import BoolArray
from stages.shape.kit import Assembly, Kit
from stages.variations.novelty.archive import cell_of_features
from stages.variations.novelty.edit_distance import edit_bounds
from stages.variations.novelty.features import AXES, MIN_MIXTURE
from stages.variations.novelty.kit_overlap import overlap_sentence
from stages.variations.novelty.low_diversity import mutual_distance
from stages.variations.report.split_report import shortage
from stages.variations.settings import NoveltyConfig

QUANTILES = (0.0, 0.1, 0.5, 0.9, 1.0)
MAX_PIECES_OF_A_ROW = 4
"""A variant of one exemplar that so few verbatim pieces cover is only longer or shorter, in one direction or in two.
Any other has a new plan."""
EDIT_SAMPLE_SIZE = 24
"""Variants that are compared with the exemplars part by part."""


def pool_measures(
    counts: np.ndarray, features: np.ndarray, digests: np.ndarray, novelty: NoveltyConfig
) -> dict[str, Any]:
    """Return the measures of a set of k variants, as JSON.

    counts: int32 (k, types), parts by type
    features: float32 (k, 10)
    digests: uint8 (k, 2, 32)

    graphs, histograms: number of distinct ones
    mixed: share of variants with at least a tenth of their parts from other exemplars than the main one
    blended: share of variants with distinctive neighbourhoods of several exemplars
    distance: mean histogram metric E to the nearest exemplar (strings §5.3)
    distances: QUANTILES of the same
    mutual_distance: mean E of two variants of a sample
    copied_share: median share of parts in the largest verbatim piece
    parts: QUANTILES of the number of parts
    cells: number of filled cells of the archive
    bins: number of filled bins by axis
    """
    cells = [cell_of_features(row, novelty.axes, novelty.resolution) for row in features]
    distances, parts = features[:, AXES.index("distance")], features[:, AXES.index("parts")]
    copied = features[:, AXES.index("copied_share")]
    return {
        "graphs": len({bytes(digest) for digest in digests[:, 0]}),
        "histograms": len({bytes(row) for row in counts}),
        "mixed": _share(features[:, AXES.index("mixture")] >= MIN_MIXTURE),
        "blended": _share(features[:, AXES.index("neighbourhood_mixture")] > 0),
        "distance": round(float(distances.mean()), 4) if len(features) else 0.0,
        "distances": _quantiles(distances, 4),
        "mutual_distance": round(mutual_distance(counts), 4),
        "copied_share": round(float(np.median(copied)), 4) if len(features) else 0.0,
        "parts": _quantiles(parts, 0),
        "cells": len(set(cells)),
        "bins": {axis: len(set(steps)) for axis, steps in zip(novelty.axes, zip(*cells, strict=True), strict=False)},
    }


def have_new_plans(features: np.ndarray, pieces: np.ndarray) -> BoolArray:
    """Return which of k variants have a new plan, bool (k,): more than another length or width.

    features: float32 (k, 10)
    pieces: number of verbatim pieces that cover each, int (k,)
    """
    new: BoolArray = (pieces > MAX_PIECES_OF_A_ROW) | (features[:, AXES.index("mixture")] >= MIN_MIXTURE)
    return new


def edit_measures(kit: Kit, sample: Sequence[Assembly]) -> dict[str, Any]:
    """Return mean lower and upper bounds, `low` and `high`, of the graph edit distance to the nearest exemplar."""
    bounds = [
        np.min([edit_bounds(shape, exemplar.assembly) for exemplar in kit.exemplars], axis=0).tolist()
        for shape in sample
    ]
    low, high = np.mean(bounds, axis=0).round(1).tolist() if bounds else (0.0, 0.0)
    return {"sample": len(sample), "low": low, "high": high}


def _share(holds: np.ndarray) -> float:
    return round(float(holds.mean()), 4) if len(holds) else 0.0


def described(measures: Mapping[str, Any]) -> str:
    """Return the measures of the variants selected from a pool, in words."""
    low, _, median, _, high = measures["parts"] or [0] * 5
    edits, overlap, short = measures["edits"], _overlap(measures), shortage(measures)
    return (
        f"selected {measures['variants']:,} of {measures['pool']:,}: {measures['graphs']:,} distinct graphs, "
        f"{measures['histograms']:,} distinct histograms in {measures['cells']:,} cells; "
        f"{measures['mixed']:.0%} mix parts of the exemplars, {measures['blended']:.0%} "
        f"their neighbourhoods; mean distance E to the nearest {measures['distance']:.2f}; "
        f"{edits['low']:.0f} to {edits['high']:.0f} edits from the nearest on a sample; "
        f"in the median {measures['copied_share']:.0%} of the parts in the largest verbatim piece, "
        f"{measures['pieces']:.0f} pieces; {measures['new_plans']:.0%} new plans, {measures['whole']:.0%} hold nearly "
        f"a whole exemplar; {low:.0f} to {high:.0f} parts, median {median:.0f}"
        + (f"; {overlap}" if overlap else "")
        + (f"; fewer than asked for: {short}" if short else "")
    )


def measure_table(measures: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the measures of the variants selected of each kit as Markdown: a table, and how each search went."""
    lines = [
        "| kit | found | selected | graphs | histograms | cells | mixed | blended | E | edits | copied | whole "
        "| pieces | new plans | parts |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | --- | ---: | ---: | ---: | ---: | --- |",
    ]
    for kit, row in measures.items():
        edits, sizes = row["edits"], " / ".join(f"{size:.0f}" for size in row["parts"][1:4])
        lines.append(
            f"| {kit} | {row['pool']:,} | {row['variants']:,} | {row['graphs']:,} | {row['histograms']:,} | "
            f"{row['cells']:,} | {row['mixed']:.0%} | {row['blended']:.0%} | {row['distance']:.2f} | "
            f"{edits['low']:.0f} to {edits['high']:.0f} | {row['copied_share']:.0%} | {row['whole']:.0%} | "
            f"{row['pieces']:.0f} | {row['new_plans']:.0%} | {sizes} |"
        )
    lines += [
        "",
        "- Found, selected: valid shapes that the search found, and those in the dataset.",
        "- Graphs: different shape graphs, that is, which types of parts touch which.",
        "- Histograms: different parts lists, that is, how many parts there are of each type.",
        "- Cells: filled cells of a grid over size, cycles, mixture and distance from the exemplars.",
        "- Mixed: shapes with at least a tenth of their parts from other exemplars than the main one.",
        "- Blended: shapes with a part whose neighbours only one exemplar shows, and another part whose neighbours "
        "only another exemplar shows.",
        "- E: mean distance of parts lists from the nearest exemplar; 0 is the same list, 1 has no type in common.",
        "- Edits: mean number of parts and contacts to add or remove on the way to the nearest exemplar; lower and "
        "upper bound, on a few shapes.",
        "- Copied: median share of parts in the largest piece that one rigid transform lays on an exemplar. Two "
        "exemplars glued together: 50 %.",
        "- Whole: shapes with more than nine tenths of an exemplar in one such piece.",
        "- Pieces: median number of such pieces that cover a shape. A sample's `lineage.copied` has both numbers of "
        "its own.",
        "- New plans: shapes that take more than four such pieces, or mix exemplars; the others are only longer or "
        "shorter, in one direction or in two.",
        "- Parts: number of parts at the 10th, 50th and 90th percentile.",
        "",
        "How the search went:",
        "",
    ]
    lines += [f"- {kit}: histograms found: {growth(row['curve'])}" for kit, row in measures.items()]
    lines += [f"- {kit}: {words}" for kit, row in measures.items() if (words := _overlap(row))]
    lines += [f"- {kit}: {row['low_diversity']}" for kit, row in measures.items() if row["low_diversity"]]
    return "\n".join(lines)


def _overlap(measures: Mapping[str, Any]) -> str:
    if not measures["kit_overlap"]:
        return ""
    return overlap_sentence(measures["kit_overlap"], measures["strictness"], measures["crossings"])


def growth(curve: Sequence[Sequence[int]]) -> str:
    """Return a saturation curve, rows of tries, variants and histograms, at its quarters: how many after how many
    tries.
    """
    indices = dict.fromkeys(-(-len(curve) * quarter // 4) - 1 for quarter in range(1, 5))
    points = [curve[index] for index in indices if index >= 0]
    return ", ".join(f"{histograms:,} after {tries:,} tries" for tries, _, histograms in points)


def _quantiles(values: np.ndarray, digits: int) -> list[float]:
    """Return the values at QUANTILES; none of an empty set."""
    if not len(values):
        return []
    return [round(float(value), digits) for value in np.quantile(values, QUANTILES, method="lower")]
