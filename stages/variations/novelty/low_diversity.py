"""Whether a pool is dull: valid shapes that are copies, or all alike; and what would help."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from stages.shape.graphs.histograms import histogram_metric
from stages.shape.graphs.neighbourhoods import SLOT_LEVELS, STRICTNESS
from stages.shape.kit import Kit, Strictness

NEAR_COPY_SHARE = 0.9
"""Share of parts in the largest copied piece above which a shape is a near copy, and from which on, in the median, a
pool is dull."""
NEAR = 0.02
"""Mean distance E to the nearest exemplar under which it is."""
ALIKE = 0.05
"""Mean distance E of two of its shapes under which it is."""
COMPARED = 128
"""So many shapes are compared with each other at most."""


def mutual_distance(counts: np.ndarray) -> float:
    """Mean histogram distance E (strings §5.3) of two shapes, 0 where there are fewer. counts: int32 (k, types)."""
    chosen = counts[np.linspace(0, len(counts) - 1, min(COMPARED, len(counts))).astype(np.int64)].astype(np.int64)
    i, j = np.triu_indices(len(chosen), 1)
    if not len(i):
        return 0.0
    return float(histogram_metric(chosen[i], chosen[j]).mean())


def low_diversity(kit: Kit, measures: Mapping[str, Any]) -> str:
    """Why a pool is dull and what would help, in one sentence; empty where it is not dull, or has fewer than two
    shapes.

    measures: `variants`, how many; `copied`, median share of parts in the largest copied piece; `distance`, mean E to
    the nearest exemplar; `apart`, mean E of two.
    """
    if measures["variants"] < 2:
        return ""
    faults = []
    if measures["copied"] >= NEAR_COPY_SHARE:
        faults.append(f"half of the shapes have {measures['copied']:.0%} or more of their parts copied whole")
    if measures["distance"] < NEAR:
        faults.append(f"parts lists are almost those of the exemplars (E {measures['distance']:.3f})")
    if measures["apart"] < ALIKE:
        faults.append(f"the shapes are alike (E of two {measures['apart']:.3f})")
    if not faults:
        return ""
    return f"dull: {', '.join(faults)}; what would help: {', or '.join(_remedies(kit))}"


def _remedies(kit: Kit) -> list[str]:
    """What would make the variants of a kit more different, by the keys of a config."""
    remedies = ["a second model" if len(kit.exemplars) == 1 else "one more model of the same parts"]
    looser = _looser(kit.grammar.strictness)
    if looser is not None:
        remedies.append(f"a looser grammar (grammar: {looser})")
    if set(kit.contact_kinds) != {"face"}:
        remedies.append("neighbours by their faces alone (contact.kinds: [face])")
    if not kit.grammar.hubs and not any(len(each.removed_hubs) for each in kit.exemplars):
        remedies.append("leaving out parts that touch everything (hubs.types: auto)")
    return [*remedies, "the same layout in other proportions (proportions.samples_per_kit)"]


def _looser(strictness: Strictness) -> Strictness | None:
    """The next looser level of the same kind, by numbers of neighbours or by slots, that admits clearly more."""
    levels = SLOT_LEVELS if strictness in SLOT_LEVELS else STRICTNESS
    return next((each for each in levels[levels.index(strictness) + 1 :] if each != "count_and_set"), None)
