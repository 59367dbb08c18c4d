"""Warps of one exemplar, and how they differ."""

from __future__ import annotations

import numpy as np

from stages.proportions.warp import Lattice, Warp

MIN_GAP = 1e-9
"""Smaller differences are rounding."""


class DistinctWarps:
    """Warps of an exemplar, compared with it and each other by their signatures.

    The difference of two signatures is the greatest difference of one coordinate: where some end of a part lies, as a
    share of the diagonal.
    """

    def __init__(self, lattice: Lattice, min_difference: float) -> None:
        """Start without warps.

        min_difference: minimum difference of a warp from the exemplar and from all others
        """
        self._lattice, self._min_difference = lattice, max(min_difference, MIN_GAP)
        self._origin = lattice.signature([np.ones(len(lengths)) for lengths in lattice.lengths])
        self._points = np.empty((64, len(self._origin)))
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def is_new(self, warp: Warp) -> bool:
        """Return whether a warp differs enough from the exemplar and all that were added."""
        point = self._lattice.signature(warp)
        gaps = np.abs(self._points[: self._count] - point).max(axis=1, initial=0.0)
        return bool(
            (gaps >= self._min_difference).all()
            and np.abs(self._origin - point).max(initial=0.0) >= self._min_difference
        )

    def add(self, warp: Warp) -> None:
        """Keep a warp, whether it is new or not."""
        if self._count == len(self._points):
            self._points = np.concatenate([self._points, np.empty_like(self._points)])
        self._points[self._count] = self._lattice.signature(warp)
        self._count += 1

    def farthest_first(self, count: int) -> list[int]:
        """Return the indices of at count `count` of the added warps, farthest first.

        Each is the one farthest from the exemplar and from those before it, as long as that is far enough.
        """
        points = self._points[: self._count]
        gaps = np.abs(points - self._origin).max(axis=1, initial=0.0)
        chosen: list[int] = []
        while len(chosen) < min(count, len(points)):
            index = int(gaps.argmax())
            if gaps[index] < self._min_difference:
                break
            chosen.append(index)
            gaps = np.minimum(gaps, np.abs(points - points[index]).max(axis=1, initial=0.0))
        return chosen
