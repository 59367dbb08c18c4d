"""Ink: strokes as an image, each an even line with round ends, anti-aliased by exact distance."""

from __future__ import annotations

from collections.abc import Mapping

import numba
import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.views.strokes import BOUNDARY_LINE, CONTOUR_LINE, CREASE_LINE, OUTLINE_LINE, Strokes

CROWD_CELL = 4.0
"""Side, in pixels of the image, of the cells in which the length of lines is summed to find where they are crowded."""

FADING = np.zeros(256)
"""Exponent of the thinning of each kind of stroke where lines are crowded."""
FADING[[CREASE_LINE, BOUNDARY_LINE, CONTOUR_LINE, OUTLINE_LINE]] = 1.0, 1.0, 0.5, 0.5


def ink_strokes(
    strokes: Strokes, widths: Mapping[int, float], width: int, height: int, scale: float, crowding: float
) -> FloatArray:
    """Return the coverage 0..1 of each pixel by ink, float64 (height, width).

    widths: line width of each kind of stroke, in pixels of the image; a kind without a width is not drawn
    scale: pixels of the image for each pixel of the view in which the strokes were found
    crowding: lines closer than this, in pixels of the image, are drawn thinner in proportion (contours and outlines
        less so), so that fine detail becomes a light hatch; 0 keeps all widths
    """
    ends = strokes.ends * scale
    table = np.zeros(256)
    for kind, line in widths.items():
        table[kind] = line
    lines = _fade(ends, strokes.kinds, table, FADING, width, height, crowding)
    ink: FloatArray = _draw(ends, lines, width, height)
    return ink


@numba.njit(cache=True, error_model="numpy")
def _fade(ends, kinds, table, fading, width, height, crowding):
    """Return the width of each segment (n,), thinner where the mean spacing of lines (area over length) around it is
    small.
    """
    lines = table[kinds]
    if crowding == 0.0:
        return lines
    # A border of empty cells on all sides saves a case distinction.
    total = np.zeros((int(height / CROWD_CELL) + 4, int(width / CROWD_CELL) + 4))
    rows, columns = np.empty(len(ends), dtype=np.int32), np.empty(len(ends), dtype=np.int32)
    for k in range(len(ends)):
        rows[k] = int((ends[k, 0, 1] + ends[k, 1, 1]) / (2 * CROWD_CELL)) + 1
        columns[k] = int((ends[k, 0, 0] + ends[k, 1, 0]) / (2 * CROWD_CELL)) + 1
        if lines[k] > 0.0:
            dx, dy = ends[k, 1, 0] - ends[k, 0, 0], ends[k, 1, 1] - ends[k, 0, 1]
            total[rows[k], columns[k]] += np.sqrt(dx * dx + dy * dy)
    for k in range(len(ends)):
        length = 0.0
        for row in range(rows[k] - 1, rows[k] + 2):
            for column in range(columns[k] - 1, columns[k] + 2):
                length += total[row, column]
        room = 9 * CROWD_CELL**2 / (length * crowding)
        if room < 1.0:
            lines[k] *= room ** fading[kinds[k]]
    return lines


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
                apart = x * x + y * y
                if apart >= reach * reach:
                    continue
                cover = full * min(reach - np.sqrt(apart), 1.0)
                if cover > ink[row, column]:
                    ink[row, column] = cover
    return ink
