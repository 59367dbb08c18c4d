"""Learned edge categories as a guide: the likeliest placement of a part next to its parent in the string (§6).

A category is a pose in the *frame* of the parent (`stages.strings.categories`), so frames are propagated from the first
part of the string to each placed part.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose_kernels import compose, squared_distance
from stages.strings.categories import CategorySpace
from stages.strings.decoder import Decoded

MAX_CATEGORY_TOLERANCES = 2.0
"""Between a placement and its category, in pose tolerances."""
NO_CATEGORY_SCORE = -1e3


class Guide(NamedTuple):
    """Scores of categories for n nodes and c categories; without nodes it is no guide."""

    parents: np.ndarray  # int64 (n,): parent of each node, -1 for the first
    scores: np.ndarray  # float64 (n, c): log probability of each category
    begins: np.ndarray  # int64 (types, labels): first category of a part of a label next to one of a type
    ends: np.ndarray  # int64 (types, labels)
    types: np.ndarray  # int64 (c,): part type
    rotations: np.ndarray  # float64 (c, 3, 3), in the frame of the parent
    translations: np.ndarray  # float64 (c, 3)


_NONE = np.empty((0, 0), dtype=np.int64)
WITHOUT_GUIDE = Guide(
    np.empty(0, dtype=np.int64), np.empty((0, 0)), _NONE, _NONE, np.empty(0, dtype=np.int64), np.empty((0, 3, 3)),
    np.empty((0, 3)),
)  # fmt: skip


def guide_of(space: CategorySpace, decoded: Decoded, scores: FloatArray) -> Guide:
    """Return the guide of a decoded string. `scores`: log probabilities, float (tokens, categories)."""
    nodes = [(index, token.edge) for index, token in enumerate(decoded.tokens) if token.kind == "node"]
    types, labels = len(space.kit.types), len(space.kit.labels)
    ranges = [[space.categories_between(kind, label) for label in range(labels)] for kind in range(types)]
    return Guide(
        parents=np.array([decoded.edges[edge][0] if edge >= 0 else -1 for _, edge in nodes], dtype=np.int64),
        scores=np.maximum(scores[[index for index, _ in nodes]], NO_CATEGORY_SCORE).astype(np.float64),
        begins=np.array([[span.start for span in row] for row in ranges], dtype=np.int64),
        ends=np.array([[span.stop for span in row] for row in ranges], dtype=np.int64),
        types=space.types[:, 1].astype(np.int64),
        rotations=np.ascontiguousarray(space.poses[:, :3, :3]),
        translations=np.ascontiguousarray(space.poses[:, :3, 3]),
    )


@numba.njit(cache=True)
def score_by_category(kit, guide, graph, s, node):
    """Score the values of a node by their categories, if its parent is placed and has a frame."""
    parent = guide.parents[node]
    if parent < 0 or not s.framed[parent]:
        return
    for value in range(s.domain_start[node], s.domain_end[node]):
        if s.in_domain[value]:
            category = _category(kit, guide, graph, s, parent, value)
            s.scores[value] = guide.scores[node, category] if category >= 0 else NO_CATEGORY_SCORE


@numba.njit(cache=True)
def propagate_frames(kit, guide, graph, s, value):
    """Set the frame of the part placed last, and then those of its placed descendants."""
    node = s.nodes[value]
    for child in range(node, len(guide.parents)):
        parent = guide.parents[child]
        if s.assigned[child] < 0 or s.framed[child] or (child != node and (parent < 0 or not s.framed[parent])):
            continue
        if parent < 0:
            s.frame_rotations[child] = s.rotations[value]
            s.frame_translations[child] = s.translations[value]
            s.framed[child] = True
        elif s.framed[parent]:
            category = _category(kit, guide, graph, s, parent, s.assigned[child])
            if category >= 0:
                compose(
                    s.frame_rotations[parent], s.frame_translations[parent],
                    guide.rotations[category], guide.translations[category],
                    s.frame_rotations[child], s.frame_translations[child],
                )  # fmt: skip
                s.framed[child] = True


@numba.njit(cache=True)
def drop_frames(guide, s):
    """Drop the frames of removed parts and of their descendants."""
    for node in range(len(guide.parents)):
        parent = guide.parents[node]
        if s.assigned[node] < 0 or (parent >= 0 and not s.framed[parent]):
            s.framed[node] = False


@numba.njit(cache=True)
def _category(kit, guide, graph, s, parent, value):
    """Return the category of a value in the frame of its parent, or -1."""
    kind, label = s.types[value], graph.labels[s.nodes[value]]
    on = s.types[s.assigned[parent]]
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
