"""What runs along a row without being part of it, such as a cable next to a mast.

It is cut where the row's copies meet, and its chunks go with the copies, so that the row can be longer or shorter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stages.shape.arrays import BoolArray, FloatArray, IntArray
from stages.shape.geometry.connected_faces import connected_faces
from stages.shape.geometry.pose import rotation_angle
from stages.symmetry.surface.grid import SurfaceGrid
from stages.symmetry.surface.soup import Soup, cut_by_plane, join_soups
from stages.symmetry.surface.welding import weld

MIN_COPIES_PER_ROW = 3
MIN_STEPS_ALONG = 2.0
"""What runs along a row is longer than this many of its steps."""


@dataclass(frozen=True)
class CopyRow:
    """Copies at multiples of a translation.

    direction: float64 (3,), unit length
    step: distance between neighbouring copies
    multiples: int64 (n,), of each copy
    """

    direction: FloatArray
    step: float
    multiples: np.ndarray


def find_row(poses: Sequence[FloatArray], tolerance: float) -> CopyRow | None:
    """Return the row of poses (4, 4), which begin with the identity.

    None where copies turn, do not lie on a line, or not at multiples of one step.
    """
    if len(poses) < MIN_COPIES_PER_ROW or (rotation_angle(np.array(poses)) > tolerance).any():
        return None
    shifts = np.array([pose[:3, 3] for pose in poses])
    direction = shifts[np.linalg.norm(shifts, axis=1).argmax()]
    direction = direction / np.linalg.norm(direction)
    along = shifts @ direction
    step = float(np.diff(np.sort(along)).min())
    if step <= tolerance or np.linalg.norm(shifts - along[:, None] * direction, axis=1).max() > tolerance:
        return None
    multiples = np.round(along / step)
    if np.abs(along - multiples * step).max() > tolerance:
        return None
    return CopyRow(direction, step, multiples.astype(np.int64))


def chunks_along(copy: Soup, row: CopyRow, rest: Soup, grid: SurfaceGrid) -> tuple[list[Soup], Soup]:
    """Cut what runs along a row across it; return the chunk of each copy, where that copy is, and the remaining soup.

    copy: triangles of the copy at multiple 0
    rest: triangles among which is what runs along the row

    Connected triangles count if they are longer than MIN_STEPS_ALONG steps of the row. Seen along the row, they must
    lie within the radius of the box of its copies. Fragments inside the box of such triangles go with them.
    """
    frame = np.linalg.qr(np.column_stack([row.direction, np.eye(3)]))[0]
    frame[:, 0] = row.direction
    own, corners = copy.corners @ frame, rest.corners @ frame
    begin = float(own[..., 0].min())
    component = _components(rest, grid.tolerance)
    count = component.max(initial=-1) + 1
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, component, corners.min(axis=1))
    np.maximum.at(high, component, corners.max(axis=1))
    near_row = (low[:, 1:] > own[..., 1:].min(axis=(0, 1)) - grid.radius).all(axis=1)
    near_row &= (high[:, 1:] < own[..., 1:].max(axis=(0, 1)) + grid.radius).all(axis=1)
    along = np.flatnonzero(near_row & (high[:, 0] - low[:, 0] > MIN_STEPS_ALONG * row.step))
    held = (low[:, None] > low[along] - grid.tolerance) & (high[:, None] < high[along] + grid.tolerance)
    inside = np.asarray(held.all(axis=2))
    chosen: BoolArray = np.asarray(inside.any(axis=1))[component]
    left, runner = rest.select(~chosen), rest.select(chosen)
    chunks = []
    for multiple in row.multiples.tolist():
        at = begin + multiple * row.step
        before, after = cut_by_plane(runner, row.direction, at)
        chunk, after = cut_by_plane(after, row.direction, at + row.step)
        runner = join_soups(before, after)
        chunks.append(chunk)
    return chunks, join_soups(left, runner)


def _components(soup: Soup, tolerance: float) -> IntArray:
    """Return the connected component of each triangle, int32 (t,); corners within about `tolerance` are the same."""
    if not len(soup):
        return np.empty(0, dtype=np.int32)
    indices, vertices = weld(soup.corners, tolerance)
    return connected_faces(vertices, indices, np.zeros(len(soup), dtype=np.int64))
