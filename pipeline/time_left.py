"""Estimate of the remaining time: late rather than wrong, and without jumps."""

from __future__ import annotations

import math

_MIN_SECONDS, _SUFFICIENT_SECONDS = 5.0, 60.0
_MIN_SHARE = 0.02
_SMOOTHING_SECONDS = 10.0
"""Time constant with which the estimate follows changes."""


class TimeLeft:
    """Estimates from the growth of work, in any unit such as samples; times are seconds of one clock."""

    def __init__(self) -> None:
        self._first: float | None = None
        self._start: tuple[float, float] | None = None
        self._estimate: tuple[float, float] | None = None

    def after(self, worked: float, work: float, now: float) -> float | None:
        """Return the seconds left when `worked` of `work` is done at time `now`; None while unknown, and at the end.

        Counts from the first progress on, since workers first start and compile. Needs some progress in a few seconds,
        or any in a minute.
        """
        if self._first is None:
            self._first = worked
        if self._start is None and worked > self._first:
            self._start = (worked, now)
        if self._start is None or worked >= work:
            return None
        fresh, seconds = worked - self._start[0], now - self._start[1]
        slight = fresh < _MIN_SHARE * (work - self._start[0]) and seconds < _SUFFICIENT_SECONDS
        if fresh <= 0 or seconds < _MIN_SECONDS or slight:
            return None
        left = (work - worked) * seconds / fresh
        if self._estimate is not None:
            expected, since = self._estimate[0] - (now - self._estimate[1]), now - self._estimate[1]
            left = max(expected + (left - expected) * (1 - math.exp(-since / _SMOOTHING_SECONDS)), 0.0)
        self._estimate = (left, now)
        return left
