"""Rails whose bends are wide enough for the profile swept along them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from stages.shape.arrays import FloatArray

MAX_EASING_ROUNDS = 400
LOCAL_EASING_ROUNDS = 40
"""After these, all points are moved, not only those next to a tight bend."""


def cubic(controls: npt.ArrayLike, count: int) -> FloatArray:
    """Points of a cubic Bezier piece, float64 (count + 1, k), from controls (4, k). It may have a cusp."""
    t = np.linspace(0.0, 1.0, count + 1)
    s = 1.0 - t
    weights = np.stack([s**3, 3.0 * s * s * t, 3.0 * s * t * t, t**3], axis=1)
    points: FloatArray = weights @ np.asarray(controls, dtype=np.float64)
    return points


def eased(points: FloatArray, girth: FloatArray) -> FloatArray:
    """Move points of a rail, float64 (n, 3), towards their neighbours where a bend would fold the swept mesh.

    Both ends stay.

    girth: float64 (n,), radius of the profile at the points
    """
    from stages.programs.curves.kernels import ease

    moved: FloatArray = ease(points, girth, MAX_EASING_ROUNDS, LOCAL_EASING_ROUNDS)
    return moved
