"""One figure of `make bench`: our rate beside that of a public peer, measured in the same run."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Measure:
    """`ours` and `peer` in `unit` a second and core; `peer` is None where no public peer does the same."""

    name: str
    unit: str
    ours: float
    peer_name: str = ""
    peer: float | None = None
    note: str = ""


def rate(work: Callable[[], int], seconds: float = 2.0, rounds: int = 3) -> float:
    """Items a second of `work` (which returns how many it made), the best of `rounds` rounds of about `seconds`."""
    best = 0.0
    work()
    for _ in range(rounds):
        start, made = time.perf_counter(), 0
        while time.perf_counter() - start < seconds:
            made += work()
        best = max(best, made / (time.perf_counter() - start))
    return best
