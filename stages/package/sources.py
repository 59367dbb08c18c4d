"""What the samples of each kit or program are like, gathered row by row: memory does not grow with what rows hold."""

from __future__ import annotations

import hashlib
from array import array
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

RANGES = ("parts", "contacts", "cycles")
"""The columns of the index of which a card tells least, median and most."""


class SourceTally:
    """Rows of the index of one kit or program, counted.

    samples; rooted, stable: so many of them are; spans: how often each number stands in each of the columns `RANGES`.
    """

    def __init__(self) -> None:
        self.samples = 0
        self.rooted = 0
        self.stable = 0
        self.spans: dict[str, Counter[int]] = {name: Counter() for name in RANGES}
        self._graphs = array("Q")

    def add(self, row: Mapping[str, Any]) -> None:
        """Count one more row."""
        self.samples += 1
        self.rooted += row["rooted"]
        self.stable += row["stable"]
        for name, counts in self.spans.items():
            counts[row[name]] += 1
        # eight bytes instead of a text: two of a million agree by chance in one of 40 million datasets
        digest = hashlib.blake2b(row["graph"].encode(), digest_size=8).digest()
        self._graphs.append(int.from_bytes(digest, "little"))

    @property
    def structures(self) -> int:
        """How many different graphs there are."""
        import numpy as np

        return len(np.unique(np.frombuffer(self._graphs, dtype=np.uint64))) if self._graphs else 0

    def span(self, name: str) -> str:
        """`least / median / most` of a column of `RANGES`, or `-` where there is no row."""
        counts = sorted(self.spans[name].items())
        if not counts:
            return "-"
        median = (_at(counts, (self.samples - 1) // 2) + _at(counts, self.samples // 2)) / 2
        return f"{counts[0][0]} / {median:g} / {counts[-1][0]}"

    @staticmethod
    def tallied(rows: Iterable[Mapping[str, Any]], tallies: dict[str, SourceTally]) -> Iterator[Mapping[str, Any]]:
        """Pass the rows on, and count each in the tally of its kit."""
        for row in rows:
            tallies.setdefault(row["kit"], SourceTally()).add(row)
            yield row


def _at(counts: Iterable[tuple[int, int]], place: int) -> int:
    """The number at a place of all numbers in order, each of which stands so often."""
    for number, count in counts:
        if place < count:
            return number
        place -= count
    raise IndexError(place)
