"""Frames along a rail that roll as little as they can: double reflection (Wang et al. 2008)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from stages.shape.arrays import FloatArray


def rail_axes(
    points: FloatArray, tangents: FloatArray, positions: FloatArray, closed: bool, up: npt.ArrayLike | None
) -> tuple[FloatArray, FloatArray]:
    """The axes x and y of a profile at each of n stations, float64 (n, 3) each; x cross y is the tangent.

    The frames do not roll about the tangent. On a closed rail, the angle left after a round is spread over its length.

    points, tangents: float64 (n, 3)
    positions: float64 (n,), relative arc length
    up: (3,), y leans towards it at the start; None: the world's +y, or +z for a rail steeper than 45 degrees

    Raises ValueError where `up` is parallel to the rail.
    """
    from stages.programs.curves.kernels import carry

    x, y = carry(points, tangents, positions, _start_axis(tangents[0], up), closed)
    return x, y


def _start_axis(tangent: FloatArray, up: npt.ArrayLike | None) -> FloatArray:
    """The profile's x at the start."""
    if up is None:
        up = (0.0, 0.0, 1.0) if abs(tangent[1]) > 0.7072 else (0.0, 1.0, 0.0)
    wanted = np.asarray(up, dtype=np.float64)
    (a, b, c), (u, v, w) = wanted.tolist(), tangent.tolist()
    x = np.array([b * w - c * v, c * u - a * w, a * v - b * u])
    size = float(np.sqrt(x @ x))
    if not size > 1e-6 * float(np.abs(wanted).max()):
        raise ValueError(f"up {wanted.tolist()} is parallel to the start of the rail: give a direction across it")
    return x / size
