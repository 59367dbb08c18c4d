"""Symmetry groups among the parts of one node: reflections and translations along its axes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shapeassembly.extraction.boxes import mirrored, same_box

__all__ = ["BOTTOM", "TOP", "Body", "Group", "reflections", "translations"]

BOTTOM, TOP = -1, -2
"""The ends of the bounding box, among indices of parts."""

CLOSENESS = 0.02
"""How near corners must come to those of their counterpart, as a share of the diagonal of the bounding box; how far
lengths may differ is half of it, or a tenth of the length."""


@dataclass(frozen=True)
class Body:
    """What symmetry moves: one part, or several that are connected.

    members: indices of its parts; boxes: corners (8, 3) of each leaf in the node's frame, whose origin is the centre
    of the bounding box; touches: the parts outside itself that it is attached to, with BOTTOM and TOP for
    the ends of the bounding box.
    """

    members: tuple[int, ...]
    boxes: tuple[FloatArray, ...]
    touches: frozenset[int]

    @cached_property
    def center(self) -> FloatArray:
        """The middle of the extent, float64 (3,)."""
        corners = np.concatenate(self.boxes)
        middle: FloatArray = (corners.min(axis=0) + corners.max(axis=0)) / 2
        return middle


@dataclass(frozen=True)
class Group:
    """Bodies that one macro makes of the first. bodies: indices, the first at the low end of the axis.
    anchors: what all of them touch, as the first touches it. distance: from the first to the last, in the node's
    units (translate alone)."""

    kind: Literal["reflect", "translate"]
    axis: int
    bodies: tuple[int, ...]
    anchors: frozenset[int]
    distance: float = 0.0


def reflections(bodies: Sequence[Body], axis: int, diagonal: float) -> list[Group]:
    """Pairs of bodies that are mirror images across the middle of the bounding box and touch a common part.

    diagonal: of the bounding box. A body that is its own image is in no pair.
    """
    tolerance = CLOSENESS * diagonal
    origin = np.zeros(3)
    groups: list[Group] = []
    taken: set[int] = set()
    for i, body in enumerate(bodies):
        if i in taken or body.center[axis] > -1e-3 * diagonal:
            continue
        image = tuple(mirrored(corners, origin, axis) for corners in body.boxes)
        swapped = _swapped(body.touches) if axis == 1 else body.touches
        for j, other in enumerate(bodies):
            if i == j or j in taken or other.center[axis] < 0 or not _alike(image, other.boxes, tolerance):
                continue
            common = _common([swapped, other.touches], [body, other])
            if common and not _alike(body.boxes, other.boxes, tolerance):
                groups.append(Group("reflect", axis, (i, j), _swapped(common) if axis == 1 else common))
                taken |= {i, j}
                break
    return groups


def translations(bodies: Sequence[Body], axis: int, diagonal: float, fewest: int) -> list[Group]:
    """Rows of at least `fewest` equal bodies at equal distances along `axis` that touch a common part."""
    tolerance = CLOSENESS * diagonal
    left = sorted(range(len(bodies)), key=lambda i: (bodies[i].center[axis], i))
    groups: list[Group] = []
    while left:
        first = bodies[left[0]]
        row = [i for i in left if _alike_translated(first, bodies[i], axis, tolerance)]
        row = _evenly_spaced([i for i in row if i != left[0]], left[0], bodies, axis, tolerance)
        members = [bodies[i] for i in row]
        common = _common([body.touches for body in members], members)
        if len(row) >= fewest and common:
            span = float(members[-1].center[axis] - first.center[axis])
            groups.append(Group("translate", axis, tuple(row), common, span))
            left = [i for i in left if i not in row]
        else:
            left = left[1:]
    return groups


def _alike(first: Sequence[FloatArray], second: Sequence[FloatArray], tolerance: float) -> bool:
    """Whether each box of one has its own counterpart in the other."""
    if len(first) != len(second):
        return False
    left = list(second)
    for corners in first:
        for place, other in enumerate(left):
            near = np.abs(corners.mean(axis=0) - other.mean(axis=0)).max() <= tolerance
            if near and _same_size(corners, other, tolerance / 2) and same_box(corners, other, tolerance):
                del left[place]
                break
        else:
            return False
    return True


def _same_size(first: FloatArray, second: FloatArray, tolerance: float) -> bool:
    """Whether two boxes, corners (8, 3), have the same lengths in some order."""
    one, two = (np.sort(np.linalg.norm(each[[4, 2, 1]] - each[0], axis=1)) for each in (first, second))
    return bool((np.abs(one - two) <= np.maximum(0.1 * one, tolerance)).all())


def _alike_translated(first: Body, second: Body, axis: int, tolerance: float) -> bool:
    away = second.center - first.center
    if np.abs(np.delete(away, axis)).max() > tolerance:
        return False
    translation = np.zeros(3)
    translation[axis] = away[axis]
    return _alike([corners + translation for corners in first.boxes], second.boxes, tolerance)


def _evenly_spaced(row: list[int], first: int, bodies: Sequence[Body], axis: int, tolerance: float) -> list[int]:
    """The longest row that begins with `first` and goes on in equal steps, along ascending places."""
    best = [first]
    start = bodies[first].center[axis]
    places = {i: float(bodies[i].center[axis] - start) for i in row}
    for step in sorted({place for place in places.values() if place > tolerance / 2}):
        found = [first]
        while True:
            wanted = step * len(found)
            near = [i for i in row if i not in found and abs(places[i] - wanted) <= min(tolerance, step / 4)]
            if not near:
                break
            found.append(min(near, key=lambda i: abs(places[i] - wanted)))
        if len(found) > len(best):
            best = found
    return best


def _swapped(touches: frozenset[int]) -> frozenset[int]:
    """The same parts with the bottom and the top of the bounding box exchanged."""
    return frozenset({BOTTOM: TOP, TOP: BOTTOM}.get(part, part) for part in touches)


def _common(touches: Sequence[frozenset[int]], members: Sequence[Body]) -> frozenset[int]:
    """What all members of a group touch outside the group."""
    own = {member for body in members for member in body.members}
    return frozenset.intersection(*touches) - own
