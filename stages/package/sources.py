"""Statistics of the samples of each producer and kit or program, gathered row by row in little memory."""

from __future__ import annotations

import hashlib
from array import array
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

RANGES = ("parts", "contacts", "cycles")
"""Columns of the index whose minimum, median and maximum the card lists."""


class SourceTally:
    """Statistics of the index rows of one kit or program.

    samples, rooted, stable: numbers of samples
    unit: of the coordinates, the same in all samples of a source
    spans: number of rows by value, for each column of RANGES
    """

    def __init__(self) -> None:
        self.samples = 0
        self.rooted = 0
        self.stable = 0
        self.unit = "unknown"
        self.spans: dict[str, Counter[int]] = {name: Counter() for name in RANGES}
        self._graphs = array("Q")

    def add(self, row: Mapping[str, Any]) -> None:
        """Count a row."""
        self.samples += 1
        self.rooted += row["rooted"]
        self.stable += row["stable"]
        self.unit = row.get("unit", "unknown")
        for name, counts in self.spans.items():
            counts[row[name]] += 1
        # Eight bytes instead of a text: of a million, two collide in one of 40 million datasets.
        digest = hashlib.blake2b(row["graph"].encode(), digest_size=8).digest()
        self._graphs.append(int.from_bytes(digest, "little"))

    @property
    def structures(self) -> int:
        """Return the number of distinct graphs."""
        import numpy as np

        return len(np.unique(np.frombuffer(self._graphs, dtype=np.uint64))) if self._graphs else 0

    def span(self, name: str) -> str:
        """Return `minimum / median / maximum` of a column of RANGES, or `-` without rows."""
        counts = sorted(self.spans[name].items())
        if not counts:
            return "-"
        median = (_at(counts, (self.samples - 1) // 2) + _at(counts, self.samples // 2)) / 2
        return f"{counts[0][0]} / {median:g} / {counts[-1][0]}"

    @staticmethod
    def tallied(
        rows: Iterable[Mapping[str, Any]], tallies: dict[tuple[str, str], SourceTally]
    ) -> Iterator[Mapping[str, Any]]:
        """Yield the rows, and count each in the tally of its producer and kit."""
        for row in rows:
            tallies.setdefault((row["producer"], row["kit"]), SourceTally()).add(row)
            yield row


def _at(counts: Iterable[tuple[int, int]], index: int) -> int:
    """Return the number at an index of a sorted list, given as (number, count) pairs."""
    for number, count in counts:
        if index < count:
            return number
        index -= count
    raise IndexError(index)
