"""Symmetry groups among the parts of one node: reflections and translations along its axes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shapeassembly.extraction.boxes import boxes_match, mirror_points

BOTTOM_END, TOP_END = -1, -2
"""The ends of the bounding box, among indices of parts."""

MATCH_TOLERANCE = 0.02
"""Maximum distance of corresponding corners, as a share of the bounding box's diagonal. Lengths may differ by half of
it, or by a tenth.
"""


@dataclass(frozen=True)
class SymmetryBody:
    """What symmetry moves: one part, or several connected ones.

    members: indices of its parts.
    boxes: corners (8, 3) of each leaf in the node's frame, whose origin is the centre of the bounding box.
    joints: its attachments: the outside part, or end of the bounding box, and the point (3,) on the body.
    """

    members: tuple[int, ...]
    boxes: tuple[FloatArray, ...]
    joints: tuple[tuple[int, FloatArray], ...]

    @cached_property
    def center(self) -> FloatArray:
        """The middle of the extent, float64 (3,)."""
        corners = np.concatenate(self.boxes)
        middle: FloatArray = (corners.min(axis=0) + corners.max(axis=0)) / 2
        return middle


@dataclass(frozen=True)
class SymmetryGroup:
    """Bodies that one macro makes of the first.

    bodies: indices, the first at the low end of the axis.
    anchors: what all of them are attached to.
    distance: from the first to the last, in the node's units, for translations.
    """

    kind: Literal["reflect", "translate"]
    axis: int
    bodies: tuple[int, ...]
    anchors: frozenset[int]
    distance: float = 0.0


def reflections(bodies: Sequence[SymmetryBody], axis: int, diagonal: float, *, strict: bool) -> list[SymmetryGroup]:
    """Return pairs of bodies that are mirror images across the middle of the bounding box, as are their attachments.

    diagonal: of the bounding box.
    strict: all attachments are to the same parts; otherwise one common part suffices.
    A body that is its own image is in no pair.
    """
    tolerance = MATCH_TOLERANCE * diagonal
    origin = np.zeros(3)
    groups: list[SymmetryGroup] = []
    taken: set[int] = set()
    for i, body in enumerate(bodies):
        if i in taken or body.center[axis] > -1e-3 * diagonal:
            continue
        image = tuple(mirror_points(corners, origin, axis) for corners in body.boxes)
        for j, other in enumerate(bodies):
            if i == j or j in taken or other.center[axis] < 0 or not _alike(image, other.boxes, tolerance):
                continue
            if _alike(body.boxes, other.boxes, tolerance):
                continue
            members = frozenset((*body.members, *other.members))
            mirrored_joints, joints = (
                _mirrored_joints(_outer_joints(body, members), axis),
                _outer_joints(other, members),
            )
            common = _parts(mirrored_joints) & _parts(joints)
            if common and (not strict or _attached_alike(mirrored_joints, joints, tolerance)):
                groups.append(
                    SymmetryGroup("reflect", axis, (i, j), frozenset(_opposite(part, axis) for part in common))
                )
                taken |= {i, j}
                break
    return groups


def translations(
    bodies: Sequence[SymmetryBody], axis: int, diagonal: float, min_length: int, *, strict: bool
) -> list[SymmetryGroup]:
    """Return rows of at least `min_length` equal bodies at equal distances along an axis.

    strict: they are attached alike to the same parts; otherwise one common part suffices.
    """
    tolerance = MATCH_TOLERANCE * diagonal
    left = sorted(range(len(bodies)), key=lambda i: (bodies[i].center[axis], i))
    groups: list[SymmetryGroup] = []
    while left:
        first = bodies[left[0]]
        row = [i for i in left if _alike_translated(first, bodies[i], axis, tolerance)]
        if strict:
            members = frozenset(member for i in row for member in bodies[i].members)
            row = [i for i in row if _attached_in_row(first, bodies[i], axis, members, tolerance)]
        row = _evenly_spaced([i for i in row if i != left[0]], left[0], bodies, axis, tolerance)
        members = frozenset(member for i in row for member in bodies[i].members)
        anchors = frozenset.intersection(*(_parts(_outer_joints(bodies[i], members)) for i in row))
        if len(row) >= min_length and anchors:
            span = float(bodies[row[-1]].center[axis] - first.center[axis])
            groups.append(SymmetryGroup("translate", axis, tuple(row), anchors, span))
            left = [i for i in left if i not in row]
        else:
            left = left[1:]
    return groups


_Joints = list[tuple[int, FloatArray]]


def _outer_joints(body: SymmetryBody, own: frozenset[int]) -> _Joints:
    """Return the attachments of a body to what is not in its group."""
    return [joint for joint in body.joints if joint[0] not in own]


def _parts(joints: _Joints) -> frozenset[int]:
    return frozenset(part for part, _ in joints)


def _opposite(part: int, axis: int) -> int:
    """Return what the mirror image of a body is attached to: the ends of the bounding box swap along y."""
    return {BOTTOM_END: TOP_END, TOP_END: BOTTOM_END}.get(part, part) if axis == 1 else part


def _mirrored_joints(joints: _Joints, axis: int) -> _Joints:
    return [(_opposite(part, axis), mirror_points(point, np.zeros(3), axis)) for part, point in joints]


def _attached_in_row(
    first: SymmetryBody, other: SymmetryBody, axis: int, own: frozenset[int], tolerance: float
) -> bool:
    way = np.zeros(3)
    way[axis] = other.center[axis] - first.center[axis]
    return _attached_alike(
        [(part, point + way) for part, point in _outer_joints(first, own)], _outer_joints(other, own), tolerance
    )


def _attached_alike(first: _Joints, second: _Joints, tolerance: float) -> bool:
    """Return whether attachments are to the same parts at the same points (shapeassembly App. C)."""
    left = list(second)
    for part, point in first:
        for index, (other, other_point) in enumerate(left):
            if part == other and np.abs(point - other_point).max() <= tolerance:
                del left[index]
                break
        else:
            return False
    return not left


def _alike(first: Sequence[FloatArray], second: Sequence[FloatArray], tolerance: float) -> bool:
    """Return whether each box of one has its own counterpart in the other."""
    if len(first) != len(second):
        return False
    left = list(second)
    for corners in first:
        for index, other in enumerate(left):
            near = np.abs(corners.mean(axis=0) - other.mean(axis=0)).max() <= tolerance
            if near and _same_size(corners, other, tolerance / 2) and boxes_match(corners, other, tolerance):
                del left[index]
                break
        else:
            return False
    return True


def _same_size(first: FloatArray, second: FloatArray, tolerance: float) -> bool:
    """Return whether two boxes, corners (8, 3), have the same lengths in some order."""
    one, two = (np.sort(np.linalg.norm(box[[4, 2, 1]] - box[0], axis=1)) for box in (first, second))
    return bool((np.abs(one - two) <= np.maximum(0.1 * one, tolerance)).all())


def _alike_translated(first: SymmetryBody, second: SymmetryBody, axis: int, tolerance: float) -> bool:
    away = second.center - first.center
    if np.abs(np.delete(away, axis)).max() > tolerance:
        return False
    translation = np.zeros(3)
    translation[axis] = away[axis]
    return _alike([corners + translation for corners in first.boxes], second.boxes, tolerance)


def _evenly_spaced(
    row: list[int], first: int, bodies: Sequence[SymmetryBody], axis: int, tolerance: float
) -> list[int]:
    """Return the longest row that starts with `first` and continues in equal steps."""
    best = [first]
    start = bodies[first].center[axis]
    offsets = {i: float(bodies[i].center[axis] - start) for i in row}
    for step in sorted({offset for offset in offsets.values() if offset > tolerance / 2}):
        candidate = [first]
        while True:
            target = step * len(candidate)
            near = [i for i in row if i not in candidate and abs(offsets[i] - target) <= min(tolerance, step / 4)]
            if not near:
                break
            candidate.append(min(near, key=lambda i: abs(offsets[i] - target)))
        if len(candidate) > len(best):
            best = candidate
    return best
