"""Path: from every entry a chain of parts that touch, never upwards, leads to an exit (substructures §5.3).

`entries` and `exits` are labels of parts; `through`, where it is given, those of the parts that a path may use beside
them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stages.shape.kit import Assembly, Kit
from stages.variations.constraint import Constraint, Labels, Test

__all__ = ["CONSTRAINT"]


def _test(kit: Kit, labels: Labels) -> Test:
    up = {"y": 1, "z": 2}[kit.up]
    entries, exits = (_named(kit, labels[each]) for each in ("entries", "exits"))
    usable = entries | exits | (_named(kit, labels["through"]) if labels.get("through") else True)

    def unmet(assembly: Assembly) -> str | None:
        types = kit.label_of[assembly.types]
        if not entries[types].any():
            return "no entry"
        if not exits[types].any():
            return "no exit"
        centroids = np.stack([kit.types[index].centroid for index in assembly.types])
        heights = np.einsum("nj,nj->n", assembly.poses[:, up, :3], centroids) + assembly.poses[:, up, 3]
        neighbours = assembly.neighbours()
        descends = True
        for entry in np.flatnonzero(entries[types]).tolist():
            if not _leads(neighbours, heights, usable[types], exits[types], entry, np.inf):
                return "no path from an entry to an exit"
            descends &= _leads(neighbours, heights, usable[types], exits[types], entry, kit.pose_tolerance)
        return None if descends else "a path leads upwards"

    return unmet


def _named(kit: Kit, names: Sequence[str]) -> np.ndarray:
    """Which labels of the kit are among the names, bool (labels,)."""
    found: np.ndarray = np.isin(kit.labels, list(names))
    return found


def _leads(
    neighbours: list[list[int]], heights: np.ndarray, usable: np.ndarray, is_exit: np.ndarray, start: int, rise: float
) -> bool:
    """Whether usable parts lead from one to an exit, none by more than `rise` higher than the one before."""
    seen, waiting = {start}, [start]
    while waiting:
        part = waiting.pop()
        if is_exit[part]:
            return True
        for other in neighbours[part]:
            if other not in seen and usable[other] and heights[other] <= heights[part] + rise:
                seen.add(other)
                waiting.append(other)
    return False


CONSTRAINT = Constraint(needs=("entries", "exits"), may=("through",), test=_test)
