"""The local coordinate frame of a part by extremal points (strings §6)."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray

DISTANCE_TOLERANCE = 1e-6
"""Difference up to which distances of vertices are equal, as a share of the diagonal."""


def extremal_frame(vertices: FloatArray, centroid: FloatArray) -> FloatArray:
    """Return the frame (4, 4) of a part with corners `vertices` (v, 3) and centre of gravity `centroid` (3,).

    The first axis is the shape diagonal: from the vertex farthest from the centroid to the vertex farthest from
    that one. The second points from the diagonal to the vertex with the greatest distance from it; the origin is
    that vertex's projection onto the diagonal. Equally far vertices are averaged. If their average gives no direction
    (on a cube it is the centroid), the first of them in lexicographic order is taken.
    """
    slack = DISTANCE_TOLERANCE * float(np.linalg.norm(np.ptp(vertices, axis=0)))
    start = _farthest(vertices, np.linalg.norm(vertices - centroid, axis=1), slack, away_from=centroid)
    end = _farthest(vertices, np.linalg.norm(vertices - start, axis=1), slack, away_from=start)
    diagonal = (end - start) / np.linalg.norm(end - start)
    along = (vertices - start) @ diagonal
    feet = start + along[:, None] * diagonal
    sideways = np.linalg.norm(vertices - feet, axis=1)
    tied = np.flatnonzero(sideways >= sideways.max() - slack)
    tip = vertices[tied].mean(axis=0)
    foot = start + ((tip - start) @ diagonal) * diagonal
    if np.linalg.norm(tip - foot) < 0.1 * sideways.max():
        chosen = tied[np.lexsort(np.round(vertices[tied] / max(slack, 1e-300)).T[::-1])[0]]
        tip, foot = vertices[chosen], feet[chosen]
    frame = np.eye(4)
    frame[:3, 0] = diagonal
    frame[:3, 1] = (tip - foot) / np.linalg.norm(tip - foot)
    frame[:3, 2] = np.cross(frame[:3, 0], frame[:3, 1])
    frame[:3, 3] = foot
    return frame


def _farthest(vertices: FloatArray, distances: FloatArray, slack: float, away_from: FloatArray) -> FloatArray:
    tied = np.flatnonzero(distances >= distances.max() - slack)
    mean: FloatArray = vertices[tied].mean(axis=0)
    if np.linalg.norm(mean - away_from) >= 0.1 * distances.max():
        return mean
    ranked = np.lexsort(np.round(vertices[tied] / max(slack, 1e-300)).T[::-1])
    chosen: FloatArray = vertices[tied[ranked[0]]]
    return chosen
