"""Vertices in the coordinates of a file, without the noise of the numbers that its format stores."""

from __future__ import annotations

import numpy as np

from stages.model_files.scene import ModelScene
from stages.shape.arrays import FloatArray

_DIGITS_KEPT = 7
"""Decimal digits of a model's size that are kept: 32-bit floats have seven."""


def exact_vertices(scene: ModelScene) -> list[FloatArray]:
    """Return the vertices of each placement, float64 (n, 3), so that a model has the same numbers in every format.

    They are rounded to seven digits of the longest side of the model's box.
    """
    placed = [
        scene.surfaces[place.surface].vertices @ place.pose[:3, :3].T + place.pose[:3, 3] for place in scene.placements
    ]
    low = np.min([points.min(axis=0) for points in placed], axis=0)
    high = np.max([points.max(axis=0) for points in placed], axis=0)
    size = float((high - low).max())
    decimals = _DIGITS_KEPT - 1 - int(np.floor(np.log10(size))) if size > 0.0 else _DIGITS_KEPT
    return [np.round(points, decimals) + 0.0 for points in placed]
