"""Difference of two shapes by their numbers of parts of each type (strings §5.3)."""

from __future__ import annotations

from typing import Any


def histogram_metric(first: Any, second: Any) -> Any:
    """Return E of histograms of types, from 0 to 1, of shape (...).

    first, second: numpy or torch arrays (..., types) that broadcast

    E is the number of parts that only one of the two has, as a share of the parts of both.
    """
    return abs(first - second).sum(-1) / (first.sum(-1) + second.sum(-1))
