"""Learnt edge categories as a guide: which place of a part is the likeliest beside the one that it hangs on (§6).

A category is a pose in the *frame* of the part that another hangs on in the string (`stages.strings.categories`). So a
frame is carried along with each part that is put down after the one it hangs on, from the first part of the string.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose_kernels import squared_distance
from stages.string_sampling.instantiation.transforms import compose
from stages.strings.categories import CategorySpace
from stages.strings.decoder import Decoded

MAX_CATEGORY_TOLERANCES = 2.0
"""A place has the nearest category if that is at most so many pose tolerances away."""
NO_CATEGORY_SCORE = -1e3
"""The score of a place without a category."""


class Guide(NamedTuple):
    """parents int64 (n,): the node that each hangs on, -1 for the first; none at all for no guide. scores float64
    (n, c): how likely each node has each category, as a logarithm.

    begins, ends int64 (types, labels): the categories of a part of a label beside one of a type; types int64 (c,):
    of the parts; rotations float64 (c, 3, 3), translations float64 (c, 3): in the frame of the other.
    """

    parents: np.ndarray
    scores: np.ndarray
    begins: np.ndarray
    ends: np.ndarray
    types: np.ndarray
    rotations: np.ndarray
    translations: np.ndarray


_NONE = np.empty((0, 0), dtype=np.int64)
WITHOUT_GUIDE = Guide(
    np.empty(0, dtype=np.int64), np.empty((0, 0)), _NONE, _NONE, np.empty(0, dtype=np.int64), np.empty((0, 3, 3)),
    np.empty((0, 3)),
)  # fmt: skip


def guide_of(space: CategorySpace, decoded: Decoded, scores: FloatArray) -> Guide:
    """The guide to a decoded string; scores: float (tokens, categories), logarithms of how likely they are."""
    nodes = [(token, each.edge) for token, each in enumerate(decoded.tokens) if each.kind == "node"]
    types, labels = len(space.kit.types), len(space.kit.labels)
    ranges = [[space.beside(each, label) for label in range(labels)] for each in range(types)]
    return Guide(
        parents=np.array([decoded.edges[edge][0] if edge >= 0 else -1 for _, edge in nodes], dtype=np.int64),
        scores=np.maximum(scores[[token for token, _ in nodes]], NO_CATEGORY_SCORE).astype(np.float64),
        begins=np.array([[each.start for each in row] for row in ranges], dtype=np.int64),
        ends=np.array([[each.stop for each in row] for row in ranges], dtype=np.int64),
        types=space.types[:, 1].astype(np.int64),
        rotations=np.ascontiguousarray(space.poses[:, :3, :3]),
        translations=np.ascontiguousarray(space.poses[:, :3, 3]),
    )


@numba.njit(cache=True)
def score_by_category(kit, guide, graph, s, node):
    """Score the values of a node by their categories, if it hangs on a part that stands and has a frame."""
    parent = guide.parents[node]
    if parent < 0 or not s.framed[parent]:
        return
    for value in range(s.first[node], s.last[node]):
        if s.alive[value]:
            category = _category(kit, guide, graph, s, parent, value)
            s.scores[value] = guide.scores[node, category] if category >= 0 else NO_CATEGORY_SCORE


@numba.njit(cache=True)
def propagate_frames(kit, guide, graph, s, value):
    """Give the part that has been put down last its frame, and then those that hang on it and stand already."""
    node = s.nodes[value]
    for each in range(node, len(guide.parents)):
        parent = guide.parents[each]
        if s.at[each] < 0 or s.framed[each] or (each != node and (parent < 0 or not s.framed[parent])):
            continue
        if parent < 0:
            s.frame_rotations[each] = s.rotations[value]
            s.frame_translations[each] = s.translations[value]
            s.framed[each] = True
        elif s.framed[parent]:
            category = _category(kit, guide, graph, s, parent, s.at[each])
            if category >= 0:
                compose(
                    s.frame_rotations[parent], s.frame_translations[parent],
                    guide.rotations[category], guide.translations[category],
                    s.frame_rotations[each], s.frame_translations[each],
                )  # fmt: skip
                s.framed[each] = True


@numba.njit(cache=True)
def drop_frames(guide, s):
    """Forget the frames of parts that do not stand any more, and of those that had theirs from them."""
    for node in range(len(guide.parents)):
        parent = guide.parents[node]
        if s.at[node] < 0 or (parent >= 0 and not s.framed[parent]):
            s.framed[node] = False


@numba.njit(cache=True)
def _category(kit, guide, graph, s, parent, value):
    """The category of a value beside the frame of a part, or -1."""
    kind, label = s.types[value], graph.labels[s.nodes[value]]
    on = s.types[s.at[parent]]
    reach = kit.reach[kind]
    best, least = -1, (MAX_CATEGORY_TOLERANCES * kit.limits[0]) ** 2
    rotation, translation = np.empty((3, 3)), np.empty(3)
    for category in range(guide.begins[on, label], guide.ends[on, label]):
        if guide.types[category] != kind:
            continue
        compose(
            s.frame_rotations[parent], s.frame_translations[parent],
            guide.rotations[category], guide.translations[category], rotation, translation,
        )  # fmt: skip
        squared = squared_distance(translation, s.translations[value])
        if squared > least:
            continue
        turn = np.inf
        for symmetry in range(kit.symmetry_starts[kind], kit.symmetry_starts[kind + 1]):
            x = 0.0
            for i in range(3):
                for j in range(3):
                    y = -rotation[i, j]
                    for k in range(3):
                        y += s.rotations[value, i, k] * kit.symmetries[symmetry, k, j]
                    x += y * y
            turn = min(turn, x)
        squared += turn * reach * reach
        if squared <= least:
            best, least = category, squared
    return best
