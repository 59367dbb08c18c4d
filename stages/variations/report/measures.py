"""Honest measures of a set of variants: how many differ, how far they are from the exemplars, how they spread."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from stages.shape.kit import Assembly, Kit
from stages.variations.novelty.archive import cell_of
from stages.variations.novelty.edit_distance import edit_bounds
from stages.variations.novelty.features import AXES, MIN_MIXTURE
from stages.variations.novelty.kit_overlap import overlap_sentence
from stages.variations.novelty.low_diversity import mutual_distance
from stages.variations.report.split_report import shortage
from stages.variations.settings import NoveltyConfig

QUANTILES = (0.0, 0.1, 0.5, 0.9, 1.0)
SAMPLE = 24
"""So many of the chosen variants are compared with the exemplars part by part."""


def pool_measures(
    counts: np.ndarray, features: np.ndarray, digests: np.ndarray, novelty: NoveltyConfig
) -> dict[str, Any]:
    """What a set of k variants is worth, as JSON.

    counts: int32 (k, types) parts by type; features: float32 (k, 10); digests: uint8 (k, 2, 32).
    graphs, histograms: distinct ones; mixed: share of variants with at least a tenth of their parts from other
    exemplars than the main one; blended: share with neighbourhoods of several exemplars that only one each shows;
    distance: mean, and distances: quantiles 0, 0.1, 0.5, 0.9 and 1, of the histogram metric E to the nearest exemplar
    (strings §5.3); apart: mean E of two of a sample; copied: median share of parts in the largest piece copied whole;
    parts: the same quantiles of the number of parts; cells: filled cells of the archive; bins: for
    each of its axes the filled steps.
    """
    cells = [cell_of(each, novelty.axes, novelty.resolution) for each in features]
    distances, parts = features[:, AXES.index("distance")], features[:, AXES.index("parts")]
    return {
        "graphs": len({bytes(each) for each in digests[:, 0]}),
        "histograms": len({bytes(each) for each in counts}),
        "mixed": _share(features[:, AXES.index("mixture")] >= MIN_MIXTURE),
        "blended": _share(features[:, AXES.index("neighbourhood_mixture")] > 0),
        "distance": round(float(distances.mean()), 4) if len(features) else 0.0,
        "distances": _quantiles(distances, 4),
        "apart": round(mutual_distance(counts), 4),
        "copied": round(float(np.median(features[:, AXES.index("copied_share")])), 4) if len(features) else 0.0,
        "parts": _quantiles(parts, 0),
        "cells": len(set(cells)),
        "bins": {axis: len(set(steps)) for axis, steps in zip(novelty.axes, zip(*cells, strict=True), strict=False)},
    }


def edit_measures(kit: Kit, sample: Sequence[Assembly]) -> dict[str, Any]:
    """How many edits of the shape graph lie between each of some variants and its nearest exemplar, as JSON: bounds
    from below and above, `low` and `high`, means over the sample."""
    bounds = [
        np.min([edit_bounds(each, exemplar.assembly) for exemplar in kit.exemplars], axis=0).tolist() for each in sample
    ]
    low, high = np.mean(bounds, axis=0).round(1).tolist() if bounds else (0.0, 0.0)
    return {"sample": len(sample), "low": low, "high": high}


def _share(holds: np.ndarray) -> float:
    return round(float(holds.mean()), 4) if len(holds) else 0.0


def described(measures: Mapping[str, Any]) -> str:
    """The measures of the variants chosen from a pool, in words."""
    low, _, median, _, high = measures["parts"] or [0] * 5
    edits, met, short = measures["edits"], _met(measures), shortage(measures)
    return (
        f"chosen {measures['variants']:,} of {measures['pool']:,}: {measures['graphs']:,} distinct graphs, "
        f"{measures['histograms']:,} distinct histograms in {measures['cells']:,} cells; "
        f"{measures['mixed']:.0%} mix material of the exemplars, {measures['blended']:.0%} "
        f"their neighbourhoods; mean distance E to the nearest {measures['distance']:.2f}; "
        f"{edits['low']:.0f} to {edits['high']:.0f} edits from the nearest on a sample; "
        f"largest copied piece {measures['copied']:.0%} of the parts, {measures['pieces']:.0f} pieces, in the median; "
        f"{low:.0f} to {high:.0f} parts, median {median:.0f}"
        + (f"; {met}" if met else "")
        + (f"; fewer than asked for: {short}" if short else "")
    )


def measure_table(measures: Mapping[str, Mapping[str, Any]]) -> str:
    """The measures of the variants chosen of each kit as Markdown: a table, and how each search went."""
    lines = [
        "| kit | found | chosen | graphs | histograms | cells | mixed | blended | E | edits | copied | pieces "
        "| parts |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | --- | ---: | ---: | --- |",
    ]
    for kit, each in measures.items():
        edits, sizes = each["edits"], " / ".join(f"{size:.0f}" for size in each["parts"][1:4])
        lines.append(
            f"| {kit} | {each['pool']:,} | {each['variants']:,} | {each['graphs']:,} | {each['histograms']:,} | "
            f"{each['cells']:,} | {each['mixed']:.0%} | {each['blended']:.0%} | {each['distance']:.2f} | "
            f"{edits['low']:.0f} to {edits['high']:.0f} | {each['copied']:.0%} | {each['pieces']:.0f} | {sizes} |"
        )
    lines += [
        "",
        "- Found, chosen: valid shapes that the search found, and those of them that the dataset has.",
        "- Graphs: different shape graphs, that is, which types of parts touch which.",
        "- Histograms: different parts lists, that is, how many parts there are of each type.",
        "- Cells: shapes are sorted into a grid by size, cycles, mixture and distance from the exemplars; so many of "
        "its cells have a shape.",
        "- Mixed: shapes of which at least a tenth of the parts comes from other exemplars than the main one.",
        "- Blended: shapes with a part whose neighbours only one exemplar shows, and another whose neighbours only "
        "another exemplar shows.",
        "- E: how far parts lists are from that of the nearest exemplar, on average; 0 is the same list, 1 has no type "
        "in common.",
        "- Edits: how many parts and contacts must be added or taken away to come to the nearest exemplar, on average; "
        "from at least to at most, on a few shapes.",
        "- Copied: half of the shapes have at least so great a share of their parts in one piece that stands just so, "
        "moved as a whole, in an exemplar. Two exemplars glued together: 50 %.",
        "- Pieces: of so many such pieces, or fewer, half of the shapes can be put together. A sample's "
        "`lineage.copied` has both numbers of its own.",
        "- Parts: a tenth, half and nine tenths of the shapes have at most so many parts.",
        "",
        "How the search went:",
        "",
    ]
    lines += [f"- {kit}: histograms found: {growth(each['curve'])}" for kit, each in measures.items()]
    lines += [f"- {kit}: {words}" for kit, each in measures.items() if (words := _met(each))]
    lines += [f"- {kit}: {each['dull']}" for kit, each in measures.items() if each["dull"]]
    return "\n".join(lines)


def _met(measures: Mapping[str, Any]) -> str:
    if not measures["meeting"]:
        return ""
    return overlap_sentence(measures["meeting"], measures["strictness"], measures["crossings"])


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
