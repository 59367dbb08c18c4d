"""Light for portraits: shadows of a shape on itself and the ground, and how open the sky is at each pixel."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from stages.shape.arrays import BoolArray, Float32Array, FloatArray, IntArray
from stages.shape.views.buffers import RendererName, render_buffers
from stages.shape.views.camera import Camera, View
from stages.shape.views.scene import Scene

SHADOW_MAP = 1024
"""Side of the shadow map in pixels."""
GOLDEN_ANGLE = 2.399963229728653


@dataclass(frozen=True)
class KeyLight:
    """A distant light.

    direction: towards the light, in the world, float64 (3,)
    view, depth: its shadow map, depth (s, s)
    """

    direction: FloatArray
    view: View
    depth: Float32Array

    def reaches(self, points: FloatArray, *softness: float) -> list[FloatArray]:
        """Return the share 0..1 of the light that reaches world points (n, 3), blurred over each `softness`, in units.

        float64 (n,)
        """
        turned, shift = points @ self.view.eye[:3, :3].T, self.view.eye[:3, 3].copy()
        across, upwards = self.view.projection[0, 0], self.view.projection[1, 1]
        pixel = 2.0 / (across * len(self.depth))
        bias = 2.0 * pixel + 0.004 * self.view.radius
        return [_filtered(self.depth, turned, shift, across, upwards, width / pixel, bias) for width in softness]


def key_light(scene: Scene, azimuth: float, elevation: float, renderer: RendererName) -> KeyLight:
    """Return a light that shines on the scene from a direction given as a camera's is."""
    camera = Camera(azimuth, elevation, "orthographic", margin=0.02)
    view = camera.look(scene.points, scene.up)
    buffers = render_buffers(scene, camera, (SHADOW_MAP, SHADOW_MAP), 1, renderer)
    return KeyLight(view.eye[2, :3].copy(), view, buffers.depth)


def eye_positions(depth: Float32Array, view: View) -> FloatArray:
    """Return the positions of the pixels in eye space, float64 (h, w, 3); infinite depths give infinite positions."""
    height, width = depth.shape
    x = ((np.arange(width) + 0.5) * 2 / width - 1) / view.projection[0, 0]
    y = (1 - (np.arange(height) + 0.5) * 2 / height) / view.projection[1, 1]
    away = depth.astype(np.float64)
    scale = away if view.perspective else np.ones_like(away)
    return np.stack([x[None, :] * scale, y[:, None] * scale, -away], axis=-1)


def to_world(points: FloatArray, view: View) -> FloatArray:
    """Return points of eye space (n, 3) in the world."""
    moved: FloatArray = (points - view.eye[:3, 3]) @ view.eye[:3, :3]
    return moved


def ground_seen(
    wanted: BoolArray, view: View, axis: int, height: float, middle: FloatArray, reach: float
) -> tuple[IntArray, FloatArray]:
    """Return where rays through pixels meet the ground: pixel numbers, int64 (n,), and world points, float64 (n, 3).

    wanted: pixels, bool (h, w)
    axis, height: the ground is at `height` along `axis`, seen from above
    middle, reach: only points within `reach` of `middle` (3,) count
    """
    across, upwards = view.projection[0, 0], view.projection[1, 1]
    rotation, shift = view.eye[:3, :3], view.eye[:3, 3]
    seen: tuple[IntArray, FloatArray]
    seen = _ground_seen(wanted, across, upwards, view.perspective, rotation, shift, axis, height, middle, reach)
    return seen


def openness(depth: Float32Array, normal: Float32Array, positions: FloatArray, view: View, reach: float) -> FloatArray:
    """Return how much of the half-sphere over each pixel is free of nearby surfaces, float64 (h, w), 1 for background.

    positions: of the pixels in eye space, as `eye_positions` returns them

    Nearby means within `reach` (world units). Only surfaces in the picture count.
    """
    across = 2.0 / (view.projection[0, 0] * depth.shape[1])
    raw = _openness(depth, normal.astype(np.float64), positions, reach, across, view.perspective)
    smooth: FloatArray = _smoothed(raw, depth, reach)
    return smooth


@numba.njit(cache=True, error_model="numpy")
def _ground_seen(wanted, across, upwards, perspective, rotation, shift, axis, height, middle, reach):
    rows, columns = wanted.shape
    pixels, points = np.empty(rows * columns, dtype=np.int64), np.empty((rows * columns, 3))
    count = 0
    start, ray, point = np.zeros(3), np.zeros(3), np.zeros(3)
    for row in range(rows):
        for column in range(columns):
            if not wanted[row, column]:
                continue
            x = ((column + 0.5) * 2 / columns - 1) / across
            y = (1 - (row + 0.5) * 2 / rows) / upwards
            for k in range(3):
                # In perspective rays start at the eye, else in the picture, all parallel.
                away, sideways = -rotation[2, k], rotation[0, k] * x + rotation[1, k] * y
                origin = -(rotation[0, k] * shift[0] + rotation[1, k] * shift[1] + rotation[2, k] * shift[2])
                start[k] = origin if perspective else origin + sideways
                ray[k] = away + sideways if perspective else away
            if ray[axis] >= -1e-9:
                continue
            long = (height - start[axis]) / ray[axis]
            distance = 0.0
            for k in range(3):
                point[k] = start[k] + long * ray[k]
                distance += (point[k] - middle[k]) ** 2
            if distance < reach * reach:
                pixels[count] = row * columns + column
                points[count] = point
                count += 1
    return pixels[:count], points[:count]


@numba.njit(cache=True, error_model="numpy")
def _filtered(depth, turned, shift, across, upwards, radius, bias):
    """Return the share of unshadowed taps of a disc of `radius` pixels around each point.

    turned, shift: points in the light's eye space, before they are moved by `shift`
    """
    lit = np.empty(len(turned))
    size = len(depth)
    taps = 32
    # Taps on a sunflower's spiral cover the disc evenly.
    spread = radius * np.sqrt((np.arange(taps) + 0.5) / taps)
    right, down = spread * np.cos(np.arange(taps) * GOLDEN_ANGLE), spread * np.sin(np.arange(taps) * GOLDEN_ANGLE)
    top, bottom, first, last = size, -1, size, -1  # of what throws a shadow
    for row in range(size):
        for column in range(size):
            if np.isfinite(depth[row, column]):
                top, bottom = min(top, row), max(bottom, row)
                first, last = min(first, column), max(last, column)
    for k in range(len(turned)):
        x = ((turned[k, 0] + shift[0]) * across + 1) / 2 * size
        y = (1 - (turned[k, 1] + shift[1]) * upwards) / 2 * size
        distance = -(turned[k, 2] + shift[2])
        outside = x < first - radius or x >= last + 1 + radius
        if outside or y < top - radius or y >= bottom + 1 + radius:
            lit[k] = 1.0
            continue
        free = 0
        for tap in range(taps):
            away = spread[tap]
            column, row = int(np.floor(x + right[tap])), int(np.floor(y + down[tap]))
            outside = column < 0 or row < 0 or column >= size or row >= size
            free += outside or depth[row, column] + bias * (1.0 + away * 0.5) >= distance
        lit[k] = free / taps
    return lit


@numba.njit(cache=True, error_model="numpy")
def _openness(depth, normal, positions, reach, across, perspective):
    height, width = depth.shape
    result = np.ones((height, width))
    taps = 20
    angles = GOLDEN_ANGLE * np.arange(taps)[None, :] + 2.0 * np.pi * np.arange(16)[:, None] / 16.0
    cosines, sines = np.cos(angles), np.sin(angles)
    for row in range(height):
        for column in range(width):
            if not np.isfinite(depth[row, column]):
                continue
            # Numbers instead of rows of arrays, whose references would be counted for every pixel.
            px, py, pz = positions[row, column, 0], positions[row, column, 1], positions[row, column, 2]
            nx, ny, nz = normal[row, column, 0], normal[row, column, 1], normal[row, column, 2]
            pixels = reach / (across * (depth[row, column] if perspective else 1.0))
            # Sixteen turns of the spiral, one for each place in a square of four by four pixels.
            start = ((row % 4) * 4 + column % 4) * 5 % 16
            hidden = 0.0
            for tap in range(taps):
                away = pixels * (tap + 0.5 + start / 16.0) / (taps + 1)
                c = int(column + 0.5 + away * cosines[start, tap])
                r = int(row + 0.5 + away * sines[start, tap])
                if c < 0 or r < 0 or c >= width or r >= height or not np.isfinite(depth[r, c]):
                    continue
                dx, dy, dz = positions[r, c, 0] - px, positions[r, c, 1] - py, positions[r, c, 2] - pz
                towards = dx * nx + dy * ny + dz * nz
                # Most taps lie on the surface itself or below it, and need no root.
                if towards <= 0.0:
                    continue
                length = np.sqrt(dx * dx + dy * dy + dz * dz)
                rise = towards / (length + 1e-12) - 0.06
                if rise > 0.0 and length < 2.0 * reach:
                    near = 1.0 - length / (2.0 * reach)
                    hidden += rise * near
            result[row, column] = max(0.0, 1.0 - 2.4 * hidden / taps)
    return result


@numba.njit(cache=True, error_model="numpy")
def _smoothed(values, depth, reach):
    """Return the mean over four by four pixels of similar depth: exactly one turn of the pattern of `_openness`."""
    height, width = values.shape
    result = values.copy()
    for row in range(height):
        for column in range(width):
            if not np.isfinite(depth[row, column]):
                continue
            total, count = 0.0, 0
            for r in range(max(row - 2, 0), min(row + 2, height)):
                for c in range(max(column - 2, 0), min(column + 2, width)):
                    if abs(depth[r, c] - depth[row, column]) < 0.25 * reach:
                        total += values[r, c]
                        count += 1
            result[row, column] = total / count
    return result
