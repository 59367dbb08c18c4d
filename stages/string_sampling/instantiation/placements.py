"""How parts may stand beside each other: the dockings of a kit with their images, as tables for the solver.

A *stance* is a part type with what is up in its coordinates, modulo its symmetries: a part stands only as parts of its
type stood in the exemplars. Where shapes need not be upright a type has one stance. A *candidate* is a place for a part
of some label beside a part in some stance.
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
    """Stances, those of one label beside each other, and candidates, those of a stance and a label beside each other.

    stance_starts int64 (labels + 1,): where the stances of a label begin; stance_types int64 (s,); rests float64
    (s, 3, 3): how one of them stood in an exemplar.
    starts int64 (s * labels + 1,): where the candidates of a stance and a label begin; stances int64 (c,); rotations
    float64 (c, 3, 3), translations float64 (c, 3): in coordinates of the part that they stand beside.
    """

    stance_starts: np.ndarray
    stance_types: np.ndarray
    rests: np.ndarray
    starts: np.ndarray
    stances: np.ndarray
    rotations: np.ndarray
    translations: np.ndarray


class _Orientation(NamedTuple):
    """up: float64 (3,) in part coordinates; rest: float64 (3, 3); turns: float64 (k, 4, 4), symmetries that keep up."""

    part_type: int
    up: FloatArray
    rest: FloatArray
    turns: FloatArray


def find_placements(kit: Kit, upright: bool) -> DockedPlacements:
    """The stances and candidates of a kit. With `upright` parts stand as they stood in the exemplars, else however
    dockings turn them."""
    stances = [
        stance
        for label in range(len(kit.labels))
        for part_type in np.flatnonzero(kit.label_of == label).tolist()
        for stance in _orientations(kit, part_type, upright)
    ]
    of_type: dict[int, list[int]] = {}
    for number, stance in enumerate(stances):
        of_type.setdefault(stance.part_type, []).append(number)
    labels = np.array([kit.label_of[each.part_type] for each in stances], dtype=np.int64)
    found: list[list[tuple[int, FloatArray]]] = [[] for _ in range(len(stances) * len(kit.labels))]
    for number, stance in enumerate(stances):
        for other, poses in _beside(kit, stance.part_type):
            others = [(each, stances[each]) for each in of_type.get(other, [])]
            for place, pose in _standing(kit, stance, others, poses, upright):
                row = found[number * len(kit.labels) + labels[place]]
                if not any(at == place and _same_place(kit, stances[at], known, pose) for at, known in row):
                    row.append((place, pose))
    flat = [each for row in found for each in row]
    poses = np.array([pose for _, pose in flat]).reshape(-1, 4, 4)
    return DockedPlacements(
        stance_starts=np.searchsorted(labels, np.arange(len(kit.labels) + 1)),
        stance_types=np.array([each.part_type for each in stances], dtype=np.int64),
        rests=np.ascontiguousarray([each.rest for each in stances]),
        starts=np.cumsum([0, *map(len, found)]),
        stances=np.array([place for place, _ in flat], dtype=np.int64),
        rotations=np.ascontiguousarray(poses[:, :3, :3]),
        translations=np.ascontiguousarray(poses[:, :3, 3]),
    )


def _orientations(kit: Kit, part_type: int, upright: bool) -> list[_Orientation]:
    """How parts of a type stood in the exemplars, hubs behind them too, modulo symmetry."""
    axis, turns = {"y": 1, "z": 2}[kit.up], kit.types[part_type].symmetries
    found: list[_Orientation] = []
    for exemplar in kit.exemplars:
        whole = exemplar.whole
        for pose in whole.poses[whole.types == part_type]:
            up = np.ascontiguousarray(pose[axis, :3])
            if not upright:
                return [_Orientation(part_type, up, pose[:3, :3], turns)]
            if not any(_keeping(kit.types[part_type], up, known.up).any() for known in found):
                kept = turns[_keeping(kit.types[part_type], up, up)]
                found.append(_Orientation(part_type, up, pose[:3, :3], kept))
    return found


def _keeping(part_type: PartType, up: FloatArray, other: FloatArray) -> np.ndarray:
    """Which symmetries bring one way up to another, bool (k,)."""
    gaps = np.linalg.norm(part_type.symmetries[:, :3, :3] @ up - other, axis=1)
    near: np.ndarray = gaps < MAX_UP_DIFFERENCE
    return near


def _beside(kit: Kit, part_type: int) -> Iterator[tuple[int, FloatArray]]:
    """By docking the other's type, and its poses (k, 4, 4) in all images under the symmetries of the part."""
    turns = kit.types[part_type].symmetries
    for docking in kit.grammar.dockings:
        if docking.a == part_type:
            yield docking.b, turns @ docking.pose
        if docking.b == part_type:
            yield docking.a, turns @ invert(docking.pose)


def _standing(
    kit: Kit, stance: _Orientation, others: list[tuple[int, _Orientation]], poses: FloatArray, upright: bool
) -> Iterator[tuple[int, FloatArray]]:
    """The stance, one of `others`, and the pose of a part at each of `poses` (k, 4, 4) beside one that stands as
    `stance`, turned by a symmetry so that up is where its stance has it; nothing where no part of its type stood so."""
    for pose in poses:
        if not upright:
            yield others[0][0], pose
            continue
        up = pose[:3, :3].T @ stance.up
        for number, other in others:
            keeping = np.flatnonzero(_keeping(kit.types[other.part_type], up, other.up))
            if len(keeping):
                # x = S x' for the part's own coordinates: up becomes S up, and the pose R S^-1
                yield number, pose @ invert(kit.types[other.part_type].symmetries[keeping[0]])
                break


def _same_place(kit: Kit, stance: _Orientation, pose: FloatArray, other: FloatArray) -> bool:
    """Whether a part looks the same at two poses."""
    length = kit.types[stance.part_type].diagonal / 2
    gaps = pose_vectors(pose @ stance.turns, length) - pose_vectors(other[None], length)
    return bool(np.linalg.norm(gaps, axis=1).min() <= kit.pose_tolerance)
