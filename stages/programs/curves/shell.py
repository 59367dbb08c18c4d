"""Solidify: a surface given by a grid of points becomes a closed shell (geocode §3.1)."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from stages.programs.curves.mesh import QuadMesh
from stages.programs.curves.vectors import cross, dots
from stages.shape.arrays import IntArray


def solidify(
    grid: npt.ArrayLike, thickness: float | npt.ArrayLike, offset: float = 0.0, closed: bool = False
) -> QuadMesh:
    """Make a shell around a surface: a seat, a backrest, a shade.

    grid: (rows, columns, 3), points of the surface, neighbours distinct; `closed` joins the last row to the first
    thickness: of the shell along the surface's normals, a number or one per point (rows, columns), above 0
    offset: position of the surface in the shell: 0 its middle, 1 its front, -1 its back. The front is in the direction
    of rows x columns: towards you where rows go right and columns go up.

    A thick shell intersects itself in a tight bend. Raises ValueError for a grid with fewer than two rows or columns
    (closed: three rows), a thickness not above 0, and a point where the grid is folded flat.
    """
    points = np.asarray(grid, dtype=np.float64)
    min_rows = 3 if closed else 2
    if points.ndim != 3 or points.shape[2] != 3 or points.shape[0] < min_rows or points.shape[1] < 2:
        raise ValueError(f"a surface needs a grid (rows from {min_rows}, columns from 2, 3), not {points.shape}")
    rows, columns = points.shape[:2]
    thick = np.broadcast_to(np.asarray(thickness, dtype=np.float64), (rows, columns)).reshape(-1, 1)
    if not thick.min() > 0.0:
        raise ValueError(f"a shell's thickness is above 0 everywhere, not {thick.min():g}")
    if closed:
        along = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    else:
        along = np.gradient(points, axis=0)
    normals = cross(along.reshape(-1, 3), np.gradient(points, axis=1).reshape(-1, 3))
    lengths = np.sqrt(dots(normals, normals))
    if lengths.min() <= 1e-9 * lengths.max():
        row, column = divmod(int(lengths.argmin()), columns)
        raise ValueError(f"the grid is folded flat at row {row}, column {column}: move its neighbours apart")
    normals *= thick / 2.0 / lengths[:, None]
    middle = points.reshape(-1, 3) - offset * normals
    return QuadMesh(np.concatenate([middle + normals, middle - normals]), _shell(rows, columns, closed))


@lru_cache(maxsize=256)
def _shell(rows: int, columns: int, closed: bool) -> IntArray:
    """Front, back and the sides between them, int32 (q, 4)."""
    index = np.arange(rows * columns).reshape(rows, columns)
    row = np.concatenate([index, index[:1]]) if closed else index
    front = np.stack([row[:-1, :-1], row[1:, :-1], row[1:, 1:], row[:-1, 1:]], axis=-1).reshape(-1, 4)
    below = rows * columns
    if closed:
        rims = [row[:, 0], row[::-1, -1]]
    else:
        rims = [np.concatenate([index[:, 0], index[-1, 1:], index[-2::-1, -1], index[0, -2::-1]])]
    walls = [np.stack([rim[1:], rim[:-1], rim[:-1] + below, rim[1:] + below], axis=1) for rim in rims]
    quads = np.concatenate([front, front[:, ::-1] + below, *walls]).astype(np.int32)
    quads.flags.writeable = False
    return quads
