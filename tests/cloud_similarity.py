"""Is a point cloud r-similar to another (symmetry §3.1)? An answer from the points alone: nothing here is shared with
the search for symmetries, or knows how a cloud was made."""

from __future__ import annotations

from typing import Any

import numpy as np

from stages.shape.arrays import BoolArray, FloatArray

MATCHED_SHARE = 0.95
"""A neighbourhood is matched if this share of its points, and of those that it lies on, have one of the other near."""
ANCHORS = 5.0
"""So many points of the exemplar along the radius are tried as images of a probe."""
TURNS = 4
"""In so many turns about the axis that points up."""
HOPES, CLOSE = 100, 8
"""Anchors whose neighbourhoods look alike in numbers, and motions of those that are looked at closely."""
GLANCE = 48
"""Points of a neighbourhood by which motions are ranked."""
STEPS = 12
"""Of moving a neighbourhood onto the nearest points (iterative closest points)."""
INNER = 0.8
"""Share of the radius within which what the exemplar has must be in the neighbourhood, too."""


def cloud_similarity(
    exemplar: FloatArray,
    shape: FloatArray,
    radius: float,
    near: float,
    up: int,
    probes: int,
    rng: np.random.Generator,
    only: BoolArray | None = None,
) -> FloatArray:
    """How much of the neighbourhood of each of `probes` random points of a shape (n, 3), of those of `only`, bool (n,),
    some motion matches with an exemplar (m, 3), float64 (probes,); from MATCHED on it is one of the exemplar's.

    Points match within a distance of `near`, that at which an exemplar that is sampled twice matches itself. Motions
    are shifts with turns about the axis `up`. Neighbourhoods are balls: what lies across a thin wall counts, too.
    """
    from scipy.spatial import KDTree

    tree, other = KDTree(exemplar), KDTree(shape)
    anchors = exemplar[_thinned(exemplar, radius / ANCHORS)]
    inside = tree.query_ball_point(anchors, radius)
    known = np.array([_numbers(exemplar[item] - at, radius, up) for at, item in zip(anchors, inside, strict=True)])
    found = np.zeros(probes)
    asked = np.arange(len(shape)) if only is None else np.flatnonzero(only)
    for place, probe in enumerate(shape[rng.choice(asked, probes, replace=False)]):
        around = shape[other.query_ball_point(probe, radius)] - probe
        alike = np.abs(known - _numbers(around, radius, up)).sum(axis=1)
        hopes = anchors[np.argsort(alike, kind="stable")[:HOPES]]
        found[place] = max(
            _share(tree, exemplar, around @ turn.T, at, radius, near)
            for turn, at in _ranked(tree, around[:: 1 + len(around) // GLANCE], hopes, up)
        )
    return found


def _thinned(points: FloatArray, size: float) -> np.ndarray:
    """The places of points (n, 3), one in each cell of a lattice."""
    _, first = np.unique(np.floor((points - points.min(axis=0)) / size).astype(np.int64), axis=0, return_index=True)
    found: np.ndarray = first
    return found


def _numbers(around: FloatArray, radius: float, up: int) -> FloatArray:
    """Numbers of a neighbourhood, points (n, 3) around the origin, that no turn about the axis `up` changes."""
    flat = np.delete(around, up, axis=1) / radius
    along = around[:, up] / radius
    spread = np.linalg.eigvalsh(flat.T @ flat / len(flat))
    found: FloatArray = np.r_[spread, along.mean(), along.std(), np.linalg.norm(flat.mean(axis=0))]
    return found


def _ranked(tree: Any, around: FloatArray, anchors: FloatArray, up: int) -> list[tuple[FloatArray, FloatArray]]:
    """The best turns (3, 3) and places (3,) to which a neighbourhood may go."""
    ways = [(turn, at) for turn in _turns(up) for at in anchors]
    off = [float(np.minimum(tree.query(around @ turn.T + at)[0], 1e300).mean()) for turn, at in ways]
    return [ways[item] for item in np.argsort(off, kind="stable")[:CLOSE]]


def _turns(up: int) -> list[FloatArray]:
    found = []
    for number in range(TURNS):
        turn = np.eye(3)
        one, other = (up + 1) % 3, (up + 2) % 3
        cosine, sine = np.cos(2 * np.pi * number / TURNS), np.sin(2 * np.pi * number / TURNS)
        turn[one, one] = turn[other, other] = cosine
        turn[one, other], turn[other, one] = -sine, sine
        found.append(turn)
    return found


def _share(tree: Any, exemplar: FloatArray, around: FloatArray, at: FloatArray, radius: float, near: float) -> float:
    """The share of a neighbourhood, and of what lies there, that match once it is moved onto the nearest points."""
    from scipy.spatial import KDTree

    middle = at.copy()
    for _ in range(STEPS):
        away, nearest = tree.query(around + middle)
        close: BoolArray = away <= max(2 * near, float(np.median(away)))
        shift = (exemplar[nearest[close]] - around[close] - middle).mean(axis=0)
        middle += shift
    away, _ = tree.query(around + middle)
    there = exemplar[tree.query_ball_point(middle, INNER * radius)] - middle
    if not len(there):
        return 0.0
    back, _ = KDTree(around).query(there)
    return float(min((away <= near).mean(), (back <= near).mean()))
