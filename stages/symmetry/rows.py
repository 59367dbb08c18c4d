"""What runs along a row without being part of it, a cable beside a mast: cut where the row's copies meet, it goes with
them, so that the row can be longer or shorter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stages.shape.arrays import BoolArray, FloatArray, IntArray
from stages.shape.geometry.connected_faces import connected_faces
from stages.shape.geometry.pose import rotation_angle
from stages.symmetry.surface.grid import SurfaceGrid
from stages.symmetry.surface.soup import Soup, join_soups
from stages.symmetry.surface.welding import weld

FEWEST = 3
"""So many copies make a row."""
SPANS = 2.0
"""What runs along a row is longer than so many of its steps."""


@dataclass(frozen=True)
class CopyRow:
    """Copies that stand at multiples of a shift. way: float64 (3,), of length 1; step: how far apart neighbours stand;
    places: int64 (n,), of each copy the multiple."""

    way: FloatArray
    step: float
    places: np.ndarray


def find_row(poses: Sequence[FloatArray], tolerance: float) -> CopyRow | None:
    """The row that poses (4, 4) make, which begin with the identity; None where they turn, stand on no line, or not at
    multiples of one step."""
    if len(poses) < FEWEST or (rotation_angle(np.array(poses)) > tolerance).any():
        return None
    shifts = np.array([pose[:3, 3] for pose in poses])
    way = shifts[np.linalg.norm(shifts, axis=1).argmax()]
    way = way / np.linalg.norm(way)
    along = shifts @ way
    step = float(np.diff(np.sort(along)).min())
    if step <= tolerance or np.linalg.norm(shifts - along[:, None] * way, axis=1).max() > tolerance:
        return None
    places = np.round(along / step)
    if np.abs(along - places * step).max() > tolerance:
        return None
    return CopyRow(way, step, places.astype(np.int64))


def chunks_along(copy: Soup, row: CopyRow, rest: Soup, grid: SurfaceGrid) -> tuple[list[Soup], Soup]:
    """What of `rest` runs along a row, cut across it: a soup for each copy, where that copy stands, and what is left.

    `copy` is the one at place 0. Connected triangles count that are longer than some steps of the row and, seen along
    it, lie no farther than the radius from the box of its copies; what lies in the box of such, torn off by the cuts
    between copies, goes with it.
    """
    frame = np.linalg.qr(np.column_stack([row.way, np.eye(3)]))[0]
    frame[:, 0] = row.way
    own, corners = copy.corners @ frame, rest.corners @ frame
    begin = float(own[..., 0].min())
    component = _components(rest, grid.tolerance)
    low, high = (
        np.full((component.max(initial=-1) + 1, 3), np.inf),
        np.full((component.max(initial=-1) + 1, 3), -np.inf),
    )
    np.minimum.at(low, component, corners.min(axis=1))
    np.maximum.at(high, component, corners.max(axis=1))
    beside = (low[:, 1:] > own[..., 1:].min(axis=(0, 1)) - grid.radius).all(axis=1)
    beside &= (high[:, 1:] < own[..., 1:].max(axis=(0, 1)) + grid.radius).all(axis=1)
    along = np.flatnonzero(beside & (high[:, 0] - low[:, 0] > SPANS * row.step))
    held = (low[:, None] > low[along] - grid.tolerance) & (high[:, None] < high[along] + grid.tolerance)
    inside = np.asarray(held.all(axis=2))
    chosen: BoolArray = np.asarray(inside.any(axis=1))[component]
    left, runner = rest.select(~chosen), rest.select(chosen)
    chunks = []
    for place in row.places.tolist():
        at = begin + place * row.step
        before, after = cut_by_plane(runner, row.way, at)
        chunk, after = cut_by_plane(after, row.way, at + row.step)
        runner = join_soups(before, after)
        chunks.append(chunk)
    return chunks, join_soups(left, runner)


def cut_by_plane(soup: Soup, normal: FloatArray, offset: float) -> tuple[Soup, Soup]:
    """The triangles cut by the plane of points x with `normal` (3,) times x = `offset`: what lies below, and beyond."""
    height = soup.corners @ normal - offset
    above = height > 0
    crossing: BoolArray = np.asarray(above.any(axis=1) & ~above.all(axis=1))
    cut = soup.select(crossing)
    height, above = height[crossing], above[crossing]
    two_above = above.sum(axis=1) == 2
    alone = np.where(two_above, above.argmin(axis=1), above.argmax(axis=1))
    turn = (alone[:, None] + np.arange(3)) % 3
    tips = np.take_along_axis(cut.corners, turn[..., None], axis=1)
    height = np.take_along_axis(height, turn, axis=1)
    share = (height[:, :1] / (height[:, :1] - height[:, 1:]))[..., None]
    seam = tips[:, :1] + share * (tips[:, 1:] - tips[:, :1])
    tip = np.stack([tips[:, 0], seam[:, 0], seam[:, 1]], axis=1)
    one = np.stack([seam[:, 0], tips[:, 1], tips[:, 2]], axis=1)
    other = np.stack([seam[:, 0], tips[:, 2], seam[:, 1]], axis=1)
    pieces = Soup(np.concatenate([tip, one, other]), np.tile(cut.faces, 3))
    beyond = np.concatenate([~two_above, two_above, two_above])
    real = pieces.areas > 0
    whole: BoolArray = np.asarray((soup.corners @ normal > offset).all(axis=1))
    return (
        join_soups(soup.select(~whole & ~crossing), pieces.select(real & ~beyond)),
        join_soups(soup.select(whole), pieces.select(real & beyond)),
    )


def _components(soup: Soup, tolerance: float) -> IntArray:
    """The connected component of each triangle, int32 (t,); corners closer than about `tolerance` are one."""
    if not len(soup):
        return np.empty(0, dtype=np.int32)
    places, vertices = weld(soup.corners, tolerance)
    return connected_faces(vertices, places, np.zeros(len(soup), dtype=np.int64))
