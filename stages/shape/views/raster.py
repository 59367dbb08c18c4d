"""Which triangle each pixel shows, by rasterising: no display, no driver, no OpenGL, the same on every machine.

Corners are snapped to a grid far finer than a pixel. The rest is integers: on which side of an edge the centre of a
pixel lies, and which triangle owns it if it lies on the edge (the top-left rule: two triangles with a common edge leave
no pixel between them and share none). Depth comes from the plane of the unsnapped triangle, in double precision, and is
rounded. Of triangles at one depth the first is seen. The nearest and first triangle of a pixel is a minimum of
integers, so the order of drawing does not matter.

Nothing is clipped: `Camera.look` keeps every point in front of the eye.
"""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.arrays import FloatArray, IntArray
from stages.shape.views.camera import View
from stages.shape.views.layers import layered_moves
from stages.shape.views.scene import Scene
from stages.shape.views.screen import project_triangles

GRID_BITS = 16
"""Corners are snapped to this power of a half of a pixel, or to less if they lie far outside of the picture."""
COORDINATE_BITS = 29
"""Snapped coordinates stay below this power of two.

So an edge function, twice a product of two differences, stays below 2**61.
"""
DEPTH_STEPS = 2.0**28
"""Distinct depths between the middle of the clip range and its end."""
NOTHING = np.iinfo(np.int64).max


class RasterRenderer:
    """Draws on one thread and holds no resources."""

    name = "Shapemill's rasteriser 1"

    def triangles(self, scene: Scene, view: View, width: int, height: int) -> IntArray:
        """Return the triangle that each pixel shows, int32 (height, width), -1 for none."""
        return raster(project_triangles(scene, view, layered_moves(scene, view), width, height), width, height)

    def close(self) -> None:
        """Do nothing: no resources are held."""


def raster(screen: FloatArray, width: int, height: int) -> IntArray:
    """Return the nearest triangle at the centre of each pixel, int32 (height, width), -1 for none.

    screen: corners of triangles in pixels and clip depth (see `stages/shape/views/screen.py`), float64 (t, 3, 3)

    A triangle is seen from both sides, unless it has no area on the grid. Raises ValueError for corners that
    are not finite, or too far outside of the picture.
    """
    farthest = float(_farthest(screen))
    bits = COORDINATE_BITS - int(np.frexp(farthest)[1]) if np.isfinite(farthest) else 0
    if bits < 1:
        raise ValueError(f"corners of triangles lie {farthest:g} pixels away: the camera is inside the shape")
    triangles: IntArray = _raster(screen, width, height, min(bits, GRID_BITS))
    return triangles


@numba.njit(cache=True, error_model="numpy")
def _farthest(screen):
    """Return the largest coordinate on the screen without its sign, at least 1; infinite if one is not finite."""
    farthest = 1.0
    for t in range(len(screen)):
        for k in range(3):
            for axis in range(2):
                size = abs(screen[t, k, axis])
                if not size <= farthest:
                    farthest = size if size > farthest else np.inf
    return farthest


@numba.njit(cache=True, error_model="numpy")
def _raster(screen, width, height, bits):
    # Of each pixel: depth above, number of the triangle below.
    nearest = np.full((height, width), NOTHING, dtype=np.int64)
    x, y = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    steps, starts, falls = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    grid, half = 2.0**bits, (1 << bits) >> 1
    for t in range(len(screen)):
        for k in range(3):
            x[k] = np.int64(np.floor(screen[t, k, 0] * grid + 0.5))
            y[k] = np.int64(np.floor(screen[t, k, 1] * grid + 0.5))
        left, right = centres_between(x, bits, width)
        top, bottom = centres_between(y, bits, height)
        if left > right or top > bottom:
            continue
        area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])
        if area == 0:
            continue
        for k in range(3):
            a, b = (k, (k + 1) % 3) if area > 0 else ((k + 1) % 3, k)
            dx, dy = x[b] - x[a], y[b] - y[a]
            owned = dy < 0 or (dy == 0 and dx > 0)
            starts[k] = dx * ((top << bits) + half - y[a]) - dy * ((left << bits) + half - x[a]) - (0 if owned else 1)
            steps[k], falls[k] = -dy << bits, dx << bits
        origin, slope, fall, low, high = _plane(screen[t], left + 0.5, top + 0.5)
        for row in range(bottom - top + 1):
            first, last = 0, right - left
            for k in range(3):
                start, step = starts[k], steps[k]
                if step > 0:
                    if start < 0:
                        first = max(first, -(start // step))
                elif start < 0:
                    last = -1
                elif step < 0:
                    last = min(last, start // -step)
                starts[k] += falls[k]
            at = origin + row * fall
            line = nearest[top + row]
            for column in range(first, last + 1):
                depth = min(max(at + column * slope, low), high)
                key = np.int64(np.int32(depth)) << 32 | t
                line[left + column] = min(line[left + column], key)
    shown = np.empty((height, width), dtype=np.int32)
    for row in range(height):
        for column in range(width):
            key = nearest[row, column]
            shown[row, column] = -1 if key == NOTHING else np.int32(key & 0xFFFFFFFF)
    return shown


@numba.njit(cache=True, error_model="numpy")
def centres_between(corners, bits, size):
    """Return the first and last of `size` pixels whose centres lie between the corners of a triangle along one axis."""
    half = (1 << bits) >> 1
    first = ((min(corners[0], corners[1], corners[2]) - half - 1) >> bits) + 1
    last = (max(corners[0], corners[1], corners[2]) - half) >> bits
    return max(first, 0), min(last, size - 1)


@numba.njit(cache=True, error_model="numpy")
def _plane(corners, x, y):
    """Return the depth of a triangle's plane at a point of the screen and its changes per pixel to the right and down.

    Then follow the smallest and largest depth of the corners; all are in steps.
    """
    ax, ay = corners[1, 0] - corners[0, 0], corners[1, 1] - corners[0, 1]
    bx, by = corners[2, 0] - corners[0, 0], corners[2, 1] - corners[0, 1]
    first, second, third = corners[0, 2] * DEPTH_STEPS, corners[1, 2] * DEPTH_STEPS, corners[2, 2] * DEPTH_STEPS
    low, high = min(first, second, third), max(first, second, third)
    area = ax * by - ay * bx
    if area == 0.0:
        return low, 0.0, 0.0, low, low
    second, third = second - first, third - first
    slope, fall = (second * by - third * ay) / area, (third * ax - second * bx) / area
    return first + (x - corners[0, 0]) * slope + (y - corners[0, 1]) * fall, slope, fall, low, high
