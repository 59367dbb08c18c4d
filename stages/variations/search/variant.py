"""A variant that a search found, and the reasons why a try found none."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from stages.shape.arrays import Float32Array, IntArray
from stages.shape.kit import Assembly
from stages.variations.kernels.outcomes import Outcome
from stages.variations.novelty.archive import Cell

DUPLICATE = "duplicate"
NEW_VARIANT = "new variant"
SUBASSEMBLY = "only a piece of an exemplar"
DISCONNECTED = "not in one piece"
LIFTED = "lifted off the ground"
UNATTACHED = "not held at a side where it always was"
OUT_OF_PROPORTION = "part type missing or out of proportion"
"""Reject reason of a variant that does not keep the part types of its exemplars."""
REASONS = {
    Outcome.WHOLE: "cut took the whole shape",
    Outcome.NO_SUCH_PART: "boundary part missing in the other shape",
    Outcome.NO_MATCH: "boundary not matched",
    Outcome.NOTHING_ATTACHED: "nothing attached",
    Outcome.TOO_SMALL: "too few parts",
    Outcome.TOO_LARGE: "too many parts",
    Outcome.CLASH: "parts clash",
    Outcome.GRAMMAR: "neighbourhood not in the grammar",
    Outcome.IDENTITY: OUT_OF_PROPORTION,
}
GROWTH_REASONS = {
    Outcome.NO_MATCH: "growth given up",
    **{outcome: f"grown: {REASONS[outcome]}" for outcome in (Outcome.TOO_SMALL, Outcome.TOO_LARGE)},
}
REPLACEMENT_REASONS = {
    Outcome.NO_MATCH: "replaced: no embedding",
    Outcome.NOTHING_ATTACHED: "replaced: only a gap to close",
    Outcome.KNOWN: DUPLICATE,
    Outcome.ASKEW: "deformed: boundaries have other angles",
    **{outcome: f"replaced: {REASONS[outcome]}" for outcome in (Outcome.TOO_SMALL, Outcome.TOO_LARGE, Outcome.GRAMMAR)},
}
EARLY_REASONS = {REASONS[outcome] for outcome in (Outcome.WHOLE, Outcome.NO_SUCH_PART, Outcome.NO_MATCH)}
"""Reasons for which an exchange ends before pieces are joined."""


@dataclass(frozen=True)
class Variant:
    """A valid new shape."""

    assembly: Assembly
    labels: IntArray  # int32 (m, 2), directed docking labels of its edges
    graph: int  # key of its graph by colour refinement
    docked: int  # the same with docking labels
    origins: np.ndarray  # int8 (n,), the exemplar that each part came from
    features: Float32Array  # float32 (10,), see `FeatureExtractor.features`
    cell: Cell
    histogram: int  # A hash of its type histogram
    lineage: dict[str, Any]
    """Parents, number of parts from each, boundary, docking transform and verbatim copies, as JSON."""
    number: int = 0  # among all that its search found, kept or not: its name there
