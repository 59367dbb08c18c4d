"""One figure of `make bench`: our rate and that of a public peer, measured in the same run."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Measure:
    """`ours` and `peer` in `unit` per second and core; `peer` stays empty without a public peer."""

    name: str
    unit: str
    ours: float
    peer_name: str = ""
    peer: float | None = None
    note: str = ""


def rate(work: Callable[[], int], seconds: float = 2.0, rounds: int = 3) -> float:
    """Return items per second of `work`, which returns its count: the best of `rounds` rounds of about `seconds`."""
    best = 0.0
    work()
    for _ in range(rounds):
        start, made = time.perf_counter(), 0
        while time.perf_counter() - start < seconds:
            made += work()
        best = max(best, made / (time.perf_counter() - start))
    return best
