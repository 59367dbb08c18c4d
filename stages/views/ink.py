"""Ink: strokes as an image, each an even line with round ends, its edge anti-aliased by its exact distance."""

from __future__ import annotations

from collections.abc import Mapping

import numba
import numpy as np

from stages.shape.arrays import FloatArray
from stages.views.strokes import BOUNDARY, CONTOUR, CREASE, Strokes

__all__ = ["ink_strokes"]

CROWD_CELL = 4.0
"""Side of the cells, in pixels of the image, in which the length of lines is summed to see how crowded they are."""

FADING = np.zeros(256)
"""How strongly each kind of stroke gives way where lines are crowded: outlines not at all, contours by half."""
FADING[[CREASE, BOUNDARY, CONTOUR]] = 1.0, 1.0, 0.5


def ink_strokes(
    strokes: Strokes, widths: Mapping[int, float], width: int, height: int, scale: float, crowding: float
) -> FloatArray:
    """Coverage 0..1 of each pixel by ink, float64 (height, width).

    widths: line width of each kind of stroke, in pixels of the image; a kind without a width is not drawn.
    scale: pixels of the image for each pixel of the view the strokes were found in.
    crowding: where lines stand closer than this, in pixels of the image, all but outlines are drawn thinner in
    proportion, so that fine detail turns into a light hatch and not into a black patch; 0 keeps all widths.
    """
    ends = strokes.ends * scale
    table = np.zeros(256)
    for kind, line in widths.items():
        table[kind] = line
    lines = table[strokes.kinds]
    if crowding > 0.0:
        spacing = _spacing(ends[lines > 0.0], width, height)
        room = np.minimum(_at(spacing, ends) / crowding, 1.0)
        lines = lines * room ** FADING[strokes.kinds]
    return _draw(ends, lines, width, height)


def _spacing(ends: FloatArray, width: int, height: int) -> FloatArray:
    """Mean spacing of lines around each cell, float64 (rows, columns): area over length, in pixels."""
    shape = int(height / CROWD_CELL) + 1, int(width / CROWD_CELL) + 1
    rows, columns = _cells(ends, shape)
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    total = np.bincount(rows * shape[1] + columns, weights=lengths, minlength=shape[0] * shape[1]).reshape(shape)
    padded = np.pad(total, 1, mode="edge")
    summed = sum(padded[r : r + shape[0], c : c + shape[1]] for r in range(3) for c in range(3))
    spacing: FloatArray = 9 * CROWD_CELL**2 / np.maximum(summed, 1e-9)
    return spacing


def _at(grid: FloatArray, ends: FloatArray) -> FloatArray:
    values: FloatArray = grid[_cells(ends, grid.shape)]
    return values


def _cells(ends: FloatArray, shape: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Row and column of the cell of the middle of each segment."""
    middles = ends.mean(axis=1) / CROWD_CELL
    rows = np.clip(middles[:, 1].astype(np.int64), 0, shape[0] - 1)
    return rows, np.clip(middles[:, 0].astype(np.int64), 0, shape[1] - 1)


@numba.njit(cache=True, error_model="numpy")
def _draw(ends, widths, width, height):
    ink = np.zeros((height, width))
    for k in range(len(ends)):
        if widths[k] <= 0.0:
            continue
        # A line thinner than a pixel is drawn a pixel wide and as much lighter.
        half, full = max(widths[k], 1.0) / 2, min(widths[k], 1.0)
        ax, ay = ends[k, 0, 0], ends[k, 0, 1]
        bx, by = ends[k, 1, 0], ends[k, 1, 1]
        reach = half + 0.5
        dx, dy = bx - ax, by - ay
        squared = dx * dx + dy * dy
        for row in range(max(int(min(ay, by) - reach), 0), min(int(max(ay, by) + reach) + 1, height)):
            for column in range(max(int(min(ax, bx) - reach), 0), min(int(max(ax, bx) + reach) + 1, width)):
                x, y = column + 0.5 - ax, row + 0.5 - ay
                along = min(max((x * dx + y * dy) / squared, 0.0), 1.0) if squared > 0.0 else 0.0
                x, y = x - along * dx, y - along * dy
                cover = full * min(reach - np.sqrt(x * x + y * y), 1.0)
                if cover > ink[row, column]:
                    ink[row, column] = cover
    return ink
