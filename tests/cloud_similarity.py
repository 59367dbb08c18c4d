"""r-similarity of a point cloud to another, from points alone (symmetry §3.1).

An oracle for tests: it shares no code with the search for symmetries.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from stages.shape.arrays import BoolArray, FloatArray

MATCHED_SHARE = 0.95
"""Share of the points of a matched neighbourhood, in both clouds, that have a point of the other nearby."""
ANCHORS_PER_RADIUS = 5.0
"""Points of the exemplar along the radius that are tried as images of a probe."""
TURN_COUNT = 4
"""Turns about the up axis that are tried."""
MAX_ANCHORS = 100
"""Anchors with the most similar descriptors that are ranked."""
MAX_REFINED = 8
"""Best ranked transforms that are refined."""
RANKING_POINTS = 48
"""Points of a neighbourhood by which transforms are ranked."""
ICP_STEPS = 12
"""Steps of iterative closest points."""
INNER_SHARE = 0.8
"""Share of the radius within which points of the exemplar must match."""


def cloud_similarity(
    exemplar: FloatArray,
    shape: FloatArray,
    radius: float,
    near: float,
    up: int,
    probes: int,
    rng: np.random.Generator,
    only: BoolArray | None = None,
) -> BoolArray:
    """Return whether the neighbourhoods of `probes` random points of a shape (n, 3) match, bool (probes,).

    only: points that may be probes, bool (n,). A neighbourhood is one of the exemplar (m, 3) from MATCHED_SHARE on.
    Points match within a distance of `near`, at which an exemplar that is sampled twice matches itself. Transforms are
    shifts with turns about the axis `up`. Neighbourhoods are balls, across thin walls as well.
    """
    from scipy.spatial import KDTree

    tree, shape_tree = KDTree(exemplar), KDTree(shape)
    anchors = exemplar[_thinned(exemplar, radius / ANCHORS_PER_RADIUS)]
    inside = tree.query_ball_point(anchors, radius)
    descriptors = np.array(
        [_descriptor(exemplar[item] - at, radius, up) for at, item in zip(anchors, inside, strict=True)]
    )
    matched = np.zeros(probes, dtype=bool)
    candidates = np.arange(len(shape)) if only is None else np.flatnonzero(only)
    for index, probe in enumerate(shape[rng.choice(candidates, probes, replace=False)]):
        around = shape[shape_tree.query_ball_point(probe, radius)] - probe
        difference = np.abs(descriptors - _descriptor(around, radius, up)).sum(axis=1)
        nearest = anchors[np.argsort(difference, kind="stable")[:MAX_ANCHORS]]
        matched[index] = any(
            _share(tree, exemplar, around @ turn.T, at, radius, near) >= MATCHED_SHARE
            for turn, at in _ranked(tree, around[:: 1 + len(around) // RANKING_POINTS], nearest, up)
        )
    return matched


def _thinned(points: FloatArray, size: float) -> np.ndarray:
    """Return the indices of one point (n, 3) in every occupied cell of a grid."""
    _, first = np.unique(np.floor((points - points.min(axis=0)) / size).astype(np.int64), axis=0, return_index=True)
    indices: np.ndarray = first
    return indices


def _descriptor(around: FloatArray, radius: float, up: int) -> FloatArray:
    """Return a descriptor of points (n, 3) around the origin that is invariant to turns about the axis `up`."""
    flat = np.delete(around, up, axis=1) / radius
    along = around[:, up] / radius
    spread = np.linalg.eigvalsh(flat.T @ flat / len(flat))
    descriptor: FloatArray = np.r_[spread, along.mean(), along.std(), np.linalg.norm(flat.mean(axis=0))]
    return descriptor


def _ranked(tree: Any, around: FloatArray, anchors: FloatArray, up: int) -> list[tuple[FloatArray, FloatArray]]:
    """Return the best transforms of a neighbourhood: turns (3, 3) and positions (3,)."""
    transforms = [(turn, at) for turn in _turns(up) for at in anchors]
    moved = np.array([around @ turn.T + at for turn, at in transforms])
    errors = np.minimum(tree.query(moved)[0], 1e300).mean(axis=1)
    return [transforms[item] for item in np.argsort(errors, kind="stable")[:MAX_REFINED]]


def _turns(up: int) -> list[FloatArray]:
    turns = []
    for number in range(TURN_COUNT):
        turn = np.eye(3)
        x, y = (up + 1) % 3, (up + 2) % 3
        cosine, sine = np.cos(2 * np.pi * number / TURN_COUNT), np.sin(2 * np.pi * number / TURN_COUNT)
        turn[x, x] = turn[y, y] = cosine
        turn[x, y], turn[y, x] = -sine, sine
        turns.append(turn)
    return turns


def _share(tree: Any, exemplar: FloatArray, around: FloatArray, at: FloatArray, radius: float, near: float) -> float:
    """Return the lesser matched share of a neighbourhood and of the exemplar there, after iterative closest points."""
    from scipy.spatial import KDTree

    middle = at.copy()
    for _ in range(ICP_STEPS):
        away, nearest = tree.query(around + middle)
        close: BoolArray = away <= max(2 * near, float(np.median(away)))
        shift = (exemplar[nearest[close]] - around[close] - middle).mean(axis=0)
        middle += shift
    away, _ = tree.query(around + middle)
    there = exemplar[tree.query_ball_point(middle, INNER_SHARE * radius)] - middle
    if not len(there):
        return 0.0
    back, _ = KDTree(around).query(there)
    return float(min((away <= near).mean(), (back <= near).mean()))
