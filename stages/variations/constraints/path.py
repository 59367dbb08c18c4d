"""Path: from every entry a chain of touching parts, never upwards, leads to an exit (substructures §5.3).

`entries` and `exits` are labels of parts; `through`, if given, those of the other parts that a path may use. A repair
resizes the parts of a path that rises, or that ends at an exit above the ground on which such exits always stood; what
is attached to them moves along.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from stages.shape.kit import Assembly, Kit
from stages.variations.constraint import GlobalConstraint, Labels, Repair, Test
from stages.variations.requirements.resizing import Resizer, heights_of, spans_of
from stages.variations.substitution.ground import GroundTest

LOWER_END, UPPER_END = 0, 1
"""Which end of the shared span of two parts stays: the lower one where a part is made lower, since both may stand on
the ground, and the upper one where it is made taller.
"""


class _Paths:
    """The paths of a kit's assemblies."""

    def __init__(self, kit: Kit, labels: Labels) -> None:
        self.kit = kit
        self.entries, self.exits = (_named(kit, labels[role]) for role in ("entries", "exits"))
        through = _named(kit, labels["through"]) if labels.get("through") else True
        self._usable = self.entries | self.exits | through

    def route(self, assembly: Assembly, heights: np.ndarray, start: int, rise: float) -> list[int]:
        """Return the shortest chain of usable parts from a start to an exit, or an empty list.

        rise: by how much a part may be higher than the one before
        """
        types, neighbours = self.kit.label_of[assembly.types], assembly.neighbours()
        usable, is_exit = self._usable[types], self.exits[types]
        before, waiting = {start: -1}, [start]
        for part in waiting:
            if is_exit[part]:
                chain = [part]
                while before[chain[-1]] >= 0:
                    chain.append(before[chain[-1]])
                return chain[::-1]
            for other in neighbours[part]:
                if other not in before and usable[other] and heights[other] <= heights[part] + rise:
                    before[other] = part
                    waiting.append(other)
        return []


def _test(kit: Kit, labels: Labels) -> Test:
    paths = _Paths(kit, labels)

    def unmet(assembly: Assembly) -> str | None:
        types = kit.label_of[assembly.types]
        if not paths.entries[types].any():
            return "no entry"
        if not paths.exits[types].any():
            return "no exit"
        heights = heights_of(kit, assembly)
        descends = True
        for entry in np.flatnonzero(paths.entries[types]).tolist():
            if not paths.route(assembly, heights, entry, np.inf):
                return "no path from an entry to an exit"
            descends &= bool(paths.route(assembly, heights, entry, kit.pose_tolerance))
        return None if descends else "a path leads upwards"

    return unmet


def _repair(kit: Kit, labels: Labels, resizer: Resizer) -> Repair:
    paths, ground = _Paths(kit, labels), GroundTest(kit, kit.contact_tolerance)

    def repaired(assembly: Assembly) -> Assembly | None:
        result: Assembly | None = assembly
        for entry in np.flatnonzero(paths.entries[kit.label_of[assembly.types]]).tolist():
            heights = heights_of(kit, assembly)
            route = paths.route(assembly, heights, entry, kit.pose_tolerance)
            if not route:
                route = paths.route(assembly, heights, entry, np.inf)
                result = None if result is None or not route else _levelled(resizer, result, route)
            if result is not None and route[-1] in ground.lifted(result.types, result.placements):
                result = _lowered(resizer, result, route)
            if result is None:
                return None
        return result

    return repaired


def _levelled(resizer: Resizer, assembly: Assembly, route: Sequence[int]) -> Assembly | None:
    """Return the assembly whose path along `route` does not rise: higher parts are made lower about where they meet."""
    result: Assembly | None = assembly
    for before, part in pairwise(route):
        if result is None:
            return None
        heights = heights_of(resizer.kit, result)
        if heights[part] <= heights[before] + resizer.kit.pose_tolerance:
            continue
        level = resizer.meeting(result, part, before, LOWER_END)
        if heights[before] <= level:
            return None
        factor = (heights[before] - level) / (heights[part] - level)
        result = resizer.resized(result, part, factor, before, LOWER_END)
    return result


def _lowered(resizer: Resizer, assembly: Assembly, route: Sequence[int]) -> Assembly | None:
    """Return the assembly in which the end of `route` reaches the ground, or None.

    Its parts, from the end on, are made taller about the place where they meet the part before, as far as needed.
    """
    result = assembly
    spans = spans_of(resizer.kit, result)
    end, missing = route[-1], float(spans[route[-1], 0] - spans[:, 0].min())
    for place in range(len(route) - 1, 0, -1):
        if missing <= resizer.kit.contact_tolerance:
            break
        before, part = route[place - 1 : place + 1]
        level = resizer.meeting(result, part, before, UPPER_END)
        low = spans_of(resizer.kit, result)[end, 0]
        if part != end:
            low = resizer.meeting(result, part, route[place + 1], UPPER_END)
        if level - low <= resizer.kit.contact_tolerance:
            continue
        factor = min(1.0 + missing / (level - low), resizer.max_factor)
        taller = resizer.resized(result, part, factor, before, UPPER_END)
        if taller is not None:
            result, missing = taller, missing - (factor - 1.0) * (level - low)
    return result if missing <= resizer.kit.contact_tolerance else None


def _named(kit: Kit, names: Sequence[str]) -> np.ndarray:
    """Return which labels of the kit are among the names, bool (labels,)."""
    is_named: np.ndarray = np.isin(kit.labels, list(names))
    return is_named


CONSTRAINT = GlobalConstraint(needs=("entries", "exits"), may=("through",), test=_test, repair=_repair)
