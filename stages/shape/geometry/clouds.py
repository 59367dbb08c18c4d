"""Distances of point clouds."""

from __future__ import annotations

from stages.shape.arrays import FloatArray


def chamfer_l1(first: FloatArray, second: FloatArray) -> float:
    """Return the mean distance to the nearest point of the other cloud, summed over both directions.

    first, second: float64 (n, 3) and (m, 3).
    """
    there, back = _nearest_distances(first, second)
    return float(there.mean() + back.mean())


def chamfer_squared(first: FloatArray, second: FloatArray) -> float:
    """Return the mean squared distance to the nearest point of the other cloud, summed over both (geocode §4.2).

    first, second: float64 (n, 3) and (m, 3).
    """
    there, back = _nearest_distances(first, second)
    return float((there**2).mean() + (back**2).mean())


def _nearest_distances(first: FloatArray, second: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the distance of each point of a cloud to the nearest of the other, float64 (n,) and (m,)."""
    from scipy.spatial import cKDTree

    return cKDTree(second).query(first)[0], cKDTree(first).query(second)[0]
