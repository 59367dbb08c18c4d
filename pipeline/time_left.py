"""How long the rest of a piece of work will take, told late rather than wrongly, and without jumps."""

from __future__ import annotations

import math

_LEAST_SECONDS, _ENOUGH_SECONDS = 5.0, 60.0
_LEAST_SHARE = 0.02
_CALM = 10.0
"""Seconds in which most of a change of mind is let through."""


class TimeLeft:
    """Watches work grow. Times are seconds of any one clock; work is in any unit, such as samples."""

    def __init__(self) -> None:
        self._seen: float | None = None
        self._start: tuple[float, float] | None = None
        self._told: tuple[float, float] | None = None

    def after(self, worked: float, work: float, now: float) -> float | None:
        """Seconds left when `worked` of `work` is done at time `now`; None while there is no basis for an answer, and
        when nothing is left.

        Counted from the first progress on: that workers start and compile at first says nothing about their pace. The
        basis is some progress in some seconds, or any in a minute.
        """
        if self._seen is None:
            self._seen = worked
        if self._start is None and worked > self._seen:
            self._start = (worked, now)
        if self._start is None or worked >= work:
            return None
        fresh, seconds = worked - self._start[0], now - self._start[1]
        slight = fresh < _LEAST_SHARE * (work - self._start[0]) and seconds < _ENOUGH_SECONDS
        if fresh <= 0 or seconds < _LEAST_SECONDS or slight:
            return None
        left = (work - worked) * seconds / fresh
        if self._told is not None:
            expected, since = self._told[0] - (now - self._told[1]), now - self._told[1]
            left = max(expected + (left - expected) * (1 - math.exp(-since / _CALM)), 0.0)
        self._told = (left, now)
        return left
