"""Path: from every entry a chain of parts that touch, never upwards, leads to an exit (substructures §5.3).

`entries` and `exits` are labels of parts; `through`, where it is given, those of the parts that a path may use beside
them. Where one rises, or ends at an exit that hangs over the ground on which its like always stood, its parts are
resized one after the other as far as they may be, and what hangs on them moves along.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from stages.shape.kit import Assembly, Kit
from stages.variations.constraint import GlobalConstraint, Labels, Repair, Test
from stages.variations.requirements.resizing import Resizer, heights_of, spans_of
from stages.variations.substitution.ground import GroundTest

LOW, HIGH = 0, 1
"""What stays of the place where two parts meet: its lower end where one is made lower, for both may stand on the
ground, its upper end where one is made taller."""


class _Paths:
    """The paths of a kit's assemblies."""

    def __init__(self, kit: Kit, labels: Labels) -> None:
        self.kit = kit
        self.entries, self.exits = (_named(kit, labels[each]) for each in ("entries", "exits"))
        through = _named(kit, labels["through"]) if labels.get("through") else True
        self._usable = self.entries | self.exits | through

    def route(self, assembly: Assembly, heights: np.ndarray, start: int, rise: float) -> list[int]:
        """The shortest chain of usable parts from one to an exit, none by more than `rise` higher than the one before;
        empty where there is none."""
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


def _mend(kit: Kit, labels: Labels, resizer: Resizer) -> Repair:
    paths, ground = _Paths(kit, labels), GroundTest(kit, kit.contact_tolerance)

    def mended(assembly: Assembly) -> Assembly | None:
        found: Assembly | None = assembly
        for entry in np.flatnonzero(paths.entries[kit.label_of[assembly.types]]).tolist():
            heights = heights_of(kit, assembly)
            route = paths.route(assembly, heights, entry, kit.pose_tolerance)
            if not route:
                route = paths.route(assembly, heights, entry, np.inf)
                found = None if found is None or not route else _levelled(resizer, found, route)
            if found is not None and route[-1] in ground.lifted(found.types, found.placements):
                found = _lowered(resizer, found, route)
            if found is None:
                return None
        return found

    return mended


def _levelled(resizer: Resizer, assembly: Assembly, route: Sequence[int]) -> Assembly | None:
    """The assembly whose path along `route` does not rise: where a part is higher than the one before it is made lower,
    about the place where they meet."""
    found: Assembly | None = assembly
    for before, part in pairwise(route):
        if found is None:
            return None
        heights = heights_of(resizer.kit, found)
        if heights[part] <= heights[before] + resizer.kit.pose_tolerance:
            continue
        level = resizer.meeting(found, part, before, LOW)
        if heights[before] <= level:
            return None
        factor = (heights[before] - level) / (heights[part] - level)
        found = resizer.resized(found, part, factor, before, LOW)
    return found


def _lowered(resizer: Resizer, assembly: Assembly, route: Sequence[int]) -> Assembly | None:
    """The assembly in which the end of `route` reaches the ground: its parts, from the end on, are made taller, each
    about the place where it meets the one before, as long as something is missing."""
    found = assembly
    spans = spans_of(resizer.kit, found)
    end, missing = route[-1], float(spans[route[-1], 0] - spans[:, 0].min())
    for place in range(len(route) - 1, 0, -1):
        if missing <= resizer.kit.contact_tolerance:
            break
        before, part = route[place - 1 : place + 1]
        level = resizer.meeting(found, part, before, HIGH)
        low = spans_of(resizer.kit, found)[end, 0]
        if part != end:
            low = resizer.meeting(found, part, route[place + 1], HIGH)
        if level - low <= resizer.kit.contact_tolerance:
            continue
        factor = min(1.0 + missing / (level - low), resizer.max_factor)
        taller = resizer.resized(found, part, factor, before, HIGH)
        if taller is not None:
            found, missing = taller, missing - (factor - 1.0) * (level - low)
    return found if missing <= resizer.kit.contact_tolerance else None


def _named(kit: Kit, names: Sequence[str]) -> np.ndarray:
    """Which labels of the kit are among the names, bool (labels,)."""
    found: np.ndarray = np.isin(kit.labels, list(names))
    return found


CONSTRAINT = GlobalConstraint(needs=("entries", "exits"), may=("through",), test=_test, repair=_mend)
