"""How unlike two shapes are by how many parts of each type they have (strings §5.3)."""

from __future__ import annotations

from typing import Any


def histogram_metric(first: Any, second: Any) -> Any:
    """E of histograms of types, (..., types) each, arrays of numpy or of torch that broadcast: (...), from 0 to 1.

    The parts that one has and the other has not, as a share of the parts of both.
    """
    return abs(first - second).sum(-1) / (first.sum(-1) + second.sum(-1))
