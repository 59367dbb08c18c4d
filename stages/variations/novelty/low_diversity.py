"""Low diversity of a pool: its shapes are valid, but copies of exemplars or nearly alike."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from stages.shape.graphs.histograms import histogram_metric
from stages.shape.graphs.neighbourhoods import SLOT_LEVELS, STRICTNESS
from stages.shape.kit import Kit, Strictness

NEAR_COPY_SHARE = 0.9
"""Share of parts in the largest verbatim piece from which a shape is a near copy; as a median, from which a pool is."""
MIN_EXEMPLAR_DISTANCE = 0.02
"""Mean histogram distance E to the nearest exemplar below which a pool has low diversity."""
MIN_MUTUAL_DISTANCE = 0.05
"""Mean histogram distance E of two shapes below which a pool has low diversity."""
MAX_SHAPES_COMPARED = 128


def mutual_distance(counts: np.ndarray) -> float:
    """Return the mean histogram distance E (strings §5.3) of two shapes, 0 for fewer than two.

    counts: int32 (k, types)
    """
    rows = np.linspace(0, len(counts) - 1, min(MAX_SHAPES_COMPARED, len(counts))).astype(np.int64)
    chosen = counts[rows].astype(np.int64)
    i, j = np.triu_indices(len(chosen), 1)
    if not len(i):
        return 0.0
    return float(histogram_metric(chosen[i], chosen[j]).mean())


def low_diversity(kit: Kit, measures: Mapping[str, Any]) -> str:
    """Return in one sentence why a pool has low diversity and what would help; empty where it is diverse or has one
    shape.

    measures["variants"]: number of variants
    measures["copied_share"]: median share of parts in the largest verbatim piece
    measures["distance"]: mean E to the nearest exemplar
    measures["mutual_distance"]: mean E of two variants
    """
    if measures["variants"] < 2:
        return ""
    faults = []
    if measures["copied_share"] >= NEAR_COPY_SHARE:
        share = measures["copied_share"]
        faults.append(f"half of the shapes have {share:.0%} or more of their parts in one verbatim piece")
    if measures["distance"] < MIN_EXEMPLAR_DISTANCE:
        faults.append(f"parts lists are almost those of the exemplars (E {measures['distance']:.3f})")
    if measures["mutual_distance"] < MIN_MUTUAL_DISTANCE:
        faults.append(f"the shapes are alike (E of two {measures['mutual_distance']:.3f})")
    if not faults:
        return ""
    return f"low diversity: {', '.join(faults)}; what would help: {', or '.join(_remedies(kit))}"


def _remedies(kit: Kit) -> list[str]:
    """Return what would make the variants of a kit more different, by the keys of a config."""
    remedies = ["a second model" if len(kit.exemplars) == 1 else "another model of the same parts"]
    looser = _looser(kit.grammar.strictness)
    if looser is not None:
        remedies.append(f"a looser grammar (grammar: {looser})")
    if set(kit.contact_kinds) != {"face"}:
        remedies.append("neighbours by their faces alone (contact.kinds: [face])")
    if not kit.grammar.hubs and not any(len(exemplar.removed_hubs) for exemplar in kit.exemplars):
        remedies.append("leaving out parts that touch everything (hubs.types: auto)")
    return [*remedies, "the same layout in other proportions (proportions.samples_per_kit)"]


def _looser(strictness: Strictness) -> Strictness | None:
    """Return the next looser level of the same family that admits clearly more, or None."""
    levels = SLOT_LEVELS if strictness in SLOT_LEVELS else STRICTNESS
    return next((level for level in levels[levels.index(strictness) + 1 :] if level != "count_and_set"), None)
