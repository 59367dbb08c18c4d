"""Rails that bend no tighter than what is swept along them can follow."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from stages.shape.arrays import FloatArray

ROUNDS, PATIENCE = 400, 40
"""So many times points are moved at most; from the second of them on all are, not only those beside a tight bend."""


def cubic(controls: npt.ArrayLike, count: int) -> FloatArray:
    """Points of a cubic Bezier piece, float64 (count + 1, k), of controls (4, k). It may have a cusp, which a curve may
    not, before it is eased."""
    t = np.linspace(0.0, 1.0, count + 1)
    s = 1.0 - t
    weights = np.stack([s**3, 3.0 * s * s * t, 3.0 * s * t * t, t**3], axis=1)
    points: FloatArray = weights @ np.asarray(controls, dtype=np.float64)
    return points


def eased(points: FloatArray, girth: FloatArray) -> FloatArray:
    """The points of a rail, float64 (n, 3), moved towards their neighbours wherever the inner side of its bends would
    fold over itself. Both ends stay.

    girth: float64 (n,), how far the profile reaches from the rail at each of the points.
    """
    from stages.programs.curves.kernels import ease

    moved: FloatArray = ease(points, girth, ROUNDS, PATIENCE)
    return moved
