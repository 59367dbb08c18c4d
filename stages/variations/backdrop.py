"""Backdrop: the hub parts that the search leaves out, put back into a finished shape where they fit."""

from __future__ import annotations

from collections import Counter

import numpy as np

from stages.shape.arrays import FloatArray, IntArray
from stages.shape.contact import world_boxes
from stages.shape.kit import Assembly, Kit, PartType
from stages.shape.pose import invert, pose_vectors
from stages.variations.answers import ContactAnswers
from stages.variations.kernels import FORBIDDEN, NONE

__all__ = ["fit_backdrop"]

FIT_SHARE = 0.75
"""A hub fits where it has at least this share of the neighbours that one of its type had in an exemplar."""


def fit_backdrop(answers: ContactAnswers, assembly: Assembly) -> Assembly:
    """`assembly` with hub parts of its kit where they fit, behind its own parts, and with their contacts.

    Places are those that observed dockings to parts of the assembly give a hub; the places that most parts agree on
    come first. A hub fits where it has most of the neighbours that one of its type had in an exemplar, and touches
    all that it touches, hubs before it too, in an observed docking; parts too near each other are refused as in the
    search.
    """
    kit = answers.kit
    types, poses = assembly.types, assembly.poses
    edges = [assembly.edges]
    boxes = world_boxes(kit.types, types, poses)
    for hub in kit.grammar.hubs:
        for place in _places(answers, hub, assembly):
            box = world_boxes(kit.types, np.array([hub]), place[None])
            near = _near(boxes, box[0], 1.1 * kit.contact_tolerance)
            touched = _touched(answers, hub, place, types, poses, near)
            if touched is None or not _has_most(kit, hub, assembly.types[touched[touched < len(assembly)]]):
                continue
            edges.append(np.column_stack([touched, np.full(len(touched), len(types))]).astype(np.int32))
            types = np.append(types, types.dtype.type(hub))
            poses = np.concatenate([poses, place[None]])
            boxes = np.concatenate([boxes, box])
    joined = np.concatenate(edges)
    return Assembly(types, poses, joined[np.lexsort((joined[:, 1], joined[:, 0]))])


def _has_most(kit: Kit, hub: int, around: np.ndarray) -> bool:
    """Whether parts of the types `around` are most of what once stood around a hub of this type."""
    counts = Counter(around.tolist())
    return any(
        sum(min(count, counts[other]) for other, count in seen) >= FIT_SHARE * sum(count for _, count in seen)
        for seen in kit.grammar.neighbourhoods[hub]
    )


def _places(answers: ContactAnswers, hub: int, assembly: Assembly) -> FloatArray:
    """The poses (k, 4, 4) that enough observed dockings to parts of the assembly give a hub, those that most give
    first; of poses that look the same one."""
    from scipy.spatial import cKDTree

    found = [
        assembly.poses[part] @ pose
        for part_type in sorted(set(assembly.types.tolist()))
        for pose in _dockings_to(answers, part_type, hub)
        for part in np.flatnonzero(assembly.types == part_type).tolist()
    ]
    if not found:
        return np.empty((0, 4, 4))
    fewest = min(sum(count for _, count in each) for each in answers.kit.grammar.neighbourhoods[hub])
    places = np.array(found)
    tree = cKDTree(places[:, :3, 3])
    agreeing = tree.query_ball_point(places[:, :3, 3], 2 * answers.kit.pose_tolerance)
    agreed = np.array([len(each) for each in agreeing])
    is_open = agreed >= FIT_SHARE * fewest
    chosen: list[int] = []
    for index in np.argsort(-agreed, kind="stable").tolist():
        if is_open[index]:
            chosen.append(index)
            beside = np.array(sorted(agreeing[index]))
            same = _look_same(answers.kit.types[hub], places[beside], places[index], answers.kit.pose_tolerance)
            is_open[beside[same]] = False
    return places[chosen]


def _dockings_to(answers: ContactAnswers, part_type: int, hub: int) -> list[FloatArray]:
    """The observed poses (4, 4) of a hub in coordinates of a part; of poses that look the same one."""
    kept: list[FloatArray] = []
    known = answers.dockings.images.get((part_type, hub))
    for pose in known[0] if known is not None else ():
        known_poses = np.array(kept).reshape(-1, 4, 4)
        if not _look_same(answers.kit.types[hub], known_poses, pose, answers.kit.pose_tolerance).any():
            kept.append(pose)
    return kept


def _look_same(part_type: PartType, poses: FloatArray, pose: FloatArray, tolerance: float) -> np.ndarray:
    """Which of the parts at `poses` (k, 4, 4) look as if they stood at `pose`, bool (k,)."""
    images = pose @ part_type.symmetries
    length = part_type.diagonal / 2
    gaps = pose_vectors(images, length)[:, None] - pose_vectors(poses, length)[None]
    same: np.ndarray = (np.linalg.norm(gaps, axis=2) <= tolerance).any(axis=0)
    return same


def _near(boxes: FloatArray, box: FloatArray, slack: float) -> list[int]:
    """Which of the `boxes` (n, 2, 3) are at most `slack` from a box (2, 3) in every axis, ascending."""
    apart = (boxes[:, 0] > box[1] + slack) | (boxes[:, 1] < box[0] - slack)
    near: list[int] = np.flatnonzero(~apart.any(axis=1)).tolist()
    return near


def _touched(
    answers: ContactAnswers, hub: int, place: FloatArray, types: np.ndarray, poses: FloatArray, near: list[int]
) -> IntArray | None:
    """Which of the parts `near` a hub at `place` touches; None where it may not stand there."""
    touched: list[int] = []
    for part in near:
        answer = answers.answer(int(types[part]), hub, invert(poses[part]) @ place)
        if answer == FORBIDDEN:
            return None
        if answer != NONE:
            touched.append(part)
    return np.array(touched, dtype=np.int32)
