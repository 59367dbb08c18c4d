"""Which samples to leave out so that no two rivals remain: those with most rivals first.

Rivals are pairs that are given, and samples of one group that differ in producer and split. A group of n samples may
have n² such pairs, so they are counted and never listed: samples of one group, producer and split have equally many.
"""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

Indices = npt.NDArray[np.int64]
Cell = tuple[int, int, int]
"""Group, producer and split."""


def left_out(pairs: Iterable[tuple[int, int]], groups: Indices, makers: Indices, splits: Indices) -> list[int]:
    """Return the samples to leave out, ascending; of several with equally many rivals one of the first split, then the
    first.

    pairs: rivals that differ in group, in producer and in split
    groups, makers, splits: of each sample, int64 (k,); makers are producers
    """
    rivals: dict[int, set[int]] = {}
    for first, second in pairs:
        rivals.setdefault(first, set()).add(second)
        rivals.setdefault(second, set()).add(first)
    cells: list[Cell] = list(zip(groups.tolist(), makers.tolist(), splits.tolist(), strict=True))
    groupmates = _Groupmates(cells)
    members: dict[Cell, list[tuple[int, int]]] = {}
    for sample, cell in enumerate(cells):
        if sample in rivals or groupmates.rivals(cell):
            members.setdefault(cell, []).append((-len(rivals.get(sample, ())), sample))
    queue = []
    for cell, own in members.items():
        heapq.heapify(own)
        queue.append((own[0][0] - groupmates.rivals(cell), cell[2], own[0][1], cell))
    heapq.heapify(queue)
    out = []
    while queue:
        # Numbers of rivals only fall, so an entry that is still right when it comes first is the largest of all.
        entry = heapq.heappop(queue)
        cell = entry[3]
        own = members[cell]
        while own and own[0][0] != -len(rivals.get(own[0][1], ())):
            heapq.heapreplace(own, (-len(rivals.get(own[0][1], ())), own[0][1]))
        worst = own[0][1]
        current = (own[0][0] - groupmates.rivals(cell), cell[2], worst, cell)
        if current != entry:
            heapq.heappush(queue, current)
        elif current[0]:
            heapq.heappop(own)
            groupmates.remove(cell)
            for other in rivals.pop(worst, ()):
                rivals[other].discard(worst)
            out.append(worst)
            if own:
                heapq.heappush(queue, (own[0][0] - groupmates.rivals(cell), cell[2], own[0][1], cell))
    return sorted(out)


class _Groupmates:
    """Numbers of samples by group and producer, by group and split, and by all three."""

    def __init__(self, cells: Iterable[Cell]) -> None:
        self._counts: Counter[tuple[int, int | None, int | None]] = Counter()
        for cell in cells:
            self._add(cell, 1)

    def rivals(self, cell: Cell) -> int:
        """Return how many samples of the group differ from those of a cell in producer and split."""
        group, maker, split = cell
        counts = self._counts
        return counts[group, None, None] - counts[group, maker, None] - counts[group, None, split] + counts[cell]

    def remove(self, cell: Cell) -> None:
        """Take one sample of a cell away."""
        self._add(cell, -1)

    def _add(self, cell: Cell, number: int) -> None:
        group, maker, split = cell
        for key in (cell, (group, maker, None), (group, None, split), (group, None, None)):
            self._counts[key] += number
