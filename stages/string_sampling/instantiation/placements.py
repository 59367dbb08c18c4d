"""Placements of parts next to each other: the dockings of a kit with their images, as tables for the solver.

An *orientation* is a part type with its up axis in part coordinates, modulo symmetry: parts are oriented as their types
are in the exemplars. If shapes need not be upright, a type has one orientation. A *placement* is a pose of a part
relative to a part in some orientation.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose import invert, pose_vectors
from stages.shape.graphs.patterns import MAX_UP_DIFFERENCE
from stages.shape.kit import Kit, PartType


class DockedPlacements(NamedTuple):
    """s orientations, grouped by label, and c placements, grouped by orientation and label."""

    orientation_starts: np.ndarray  # int64 (labels + 1,): first orientation of each label
    orientation_types: np.ndarray  # int64 (s,): part type
    rests: np.ndarray  # float64 (s, 3, 3): rotation of such a part in an exemplar
    starts: np.ndarray  # int64 (s * labels + 1,): first placement of each orientation and label
    orientations: np.ndarray  # int64 (c,): of the placed part
    rotations: np.ndarray  # float64 (c, 3, 3), in coordinates of the part that it docks to
    translations: np.ndarray  # float64 (c, 3)


class _Orientation(NamedTuple):
    part_type: int
    up: FloatArray  # float64 (3,), in part coordinates
    rest: FloatArray  # float64 (3, 3)
    turns: FloatArray  # float64 (k, 4, 4): symmetries that keep up


def find_placements(kit: Kit, upright: bool) -> DockedPlacements:
    """Find the orientations and placements of a kit; with `upright`, orientations are those of the exemplars."""
    orientations = [
        orientation
        for label in range(len(kit.labels))
        for part_type in np.flatnonzero(kit.label_of == label).tolist()
        for orientation in _orientations(kit, part_type, upright)
    ]
    of_type: dict[int, list[int]] = {}
    for number, orientation in enumerate(orientations):
        of_type.setdefault(orientation.part_type, []).append(number)
    labels = np.array([kit.label_of[orientation.part_type] for orientation in orientations], dtype=np.int64)
    rows: list[list[tuple[int, FloatArray]]] = [[] for _ in range(len(orientations) * len(kit.labels))]
    for number, orientation in enumerate(orientations):
        for other, poses in _docked_types(kit, orientation.part_type):
            others = [(index, orientations[index]) for index in of_type.get(other, [])]
            for index, pose in _oriented(kit, orientation, others, poses, upright):
                row = rows[number * len(kit.labels) + labels[index]]
                same = (known for other_index, known in row if other_index == index)
                if not any(_same_pose(kit, orientations[index], known, pose) for known in same):
                    row.append((index, pose))
    flat = [placement for row in rows for placement in row]
    poses = np.array([pose for _, pose in flat]).reshape(-1, 4, 4)
    return DockedPlacements(
        orientation_starts=np.searchsorted(labels, np.arange(len(kit.labels) + 1)),
        orientation_types=np.array([orientation.part_type for orientation in orientations], dtype=np.int64),
        rests=np.ascontiguousarray([orientation.rest for orientation in orientations]),
        starts=np.cumsum([0, *map(len, rows)]),
        orientations=np.array([index for index, _ in flat], dtype=np.int64),
        rotations=np.ascontiguousarray(poses[:, :3, :3]),
        translations=np.ascontiguousarray(poses[:, :3, 3]),
    )


def _orientations(kit: Kit, part_type: int, upright: bool) -> list[_Orientation]:
    """Return the orientations of a type in the exemplars, also of hubs, modulo symmetry."""
    axis, turns = {"y": 1, "z": 2}[kit.up], kit.types[part_type].symmetries
    found: list[_Orientation] = []
    for exemplar in kit.exemplars:
        whole = exemplar.whole
        for pose in whole.poses[whole.types == part_type]:
            up = np.ascontiguousarray(pose[axis, :3])
            if not upright:
                return [_Orientation(part_type, up, pose[:3, :3], turns)]
            if not any(_maps_up(kit.types[part_type], up, known.up).any() for known in found):
                kept = turns[_maps_up(kit.types[part_type], up, up)]
                found.append(_Orientation(part_type, up, pose[:3, :3], kept))
    return found


def _maps_up(part_type: PartType, up: FloatArray, other: FloatArray) -> np.ndarray:
    """Return which symmetries map one up axis to another, bool (k,)."""
    gaps = np.linalg.norm(part_type.symmetries[:, :3, :3] @ up - other, axis=1)
    near: np.ndarray = gaps < MAX_UP_DIFFERENCE
    return near


def _docked_types(kit: Kit, part_type: int) -> Iterator[tuple[int, FloatArray]]:
    """Yield, by docking, the other type and its poses (k, 4, 4), all images under the symmetries of the part."""
    turns = kit.types[part_type].symmetries
    for docking in kit.grammar.dockings:
        if docking.a == part_type:
            yield docking.b, turns @ docking.pose
        if docking.b == part_type:
            yield docking.a, turns @ invert(docking.pose)


def _oriented(
    kit: Kit, orientation: _Orientation, others: list[tuple[int, _Orientation]], poses: FloatArray, upright: bool
) -> Iterator[tuple[int, FloatArray]]:
    """Yield orientation and pose of a part at each of `poses` (k, 4, 4) next to one in `orientation`.

    The orientation is one of `others`; the pose is turned by a symmetry that maps up to its up axis. Poses without such
    an orientation are left out.
    """
    for pose in poses:
        if not upright:
            yield others[0][0], pose
            continue
        up = pose[:3, :3].T @ orientation.up
        for number, other in others:
            turns = np.flatnonzero(_maps_up(kit.types[other.part_type], up, other.up))
            if len(turns):
                # with part coordinates x = S x', up becomes S up, and the pose R S^-1
                yield number, pose @ invert(kit.types[other.part_type].symmetries[turns[0]])
                break


def _same_pose(kit: Kit, orientation: _Orientation, pose: FloatArray, other: FloatArray) -> bool:
    """Return whether a part is the same at two poses, modulo symmetry."""
    length = kit.types[orientation.part_type].diagonal / 2
    gaps = pose_vectors(pose @ orientation.turns, length) - pose_vectors(other[None], length)
    return bool(np.linalg.norm(gaps, axis=1).min() <= kit.pose_tolerance)
