"""A surface on a sparse voxel grid: the planes and the boundary lines of its triangles in each cell (symmetry §4)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numba
import numpy as np

from stages.shape.arrays import BoolArray, FloatArray, IntArray
from stages.shape.geometry.triangles import triangle_areas, unit_normals
from stages.symmetry.surface.boundary_lines import (
    SAME_ANGLE_RADIANS,
    GridTriangles,
    boundary_lines,
    sides_that_go_on,
)
from stages.symmetry.surface.clip import fragments
from stages.symmetry.surface.lattice import neighbours_of, pack_cells, unpack_cells

CELLS_PER_RADIUS = 4
"""The radius of similarity, in cells (symmetry §4)."""
SAME_POSITION_CELLS = 1e-2
"""Planes and lines that are closer, in cells, are the same."""
MIN_HEIGHT_SHARE = 1e-7
"""A triangle of less height, as a share of its longest side, has no area."""
LATTICE_OFFSET_CELLS = (0.3819660113, 0.2360679775, 0.1458980338)
"""Position of the lowest corner in its cell: planes of models lie at round numbers, borders of cells should not."""


class GridItems(NamedTuple):
    """The items of a `SurfaceGrid` as its kernels take them; fields as there."""

    origin: FloatArray
    size: float
    keys: np.ndarray
    starts: np.ndarray
    points: FloatArray
    directions: FloatArray
    is_line: np.ndarray
    tolerance: float
    same_angle: float


@dataclass(frozen=True)
class SurfaceGrid:
    """Occupied cells of a cubic lattice, and the items in them: planes and boundary lines.

    corners: float64 (f, 3, 3), triangles with area
    faces: int32 (f,), their indices in the mesh
    origin: float64 (3,), low corner of cell (0, 0, 0)
    cell_size: width of a cell
    radius: of similarity
    keys: int64 (n,), packed cells, ascending
    cells: int64 (n, 3)
    neighbours: int32 (n, 26), -1 for empty neighbours
    area: float64 (n,), of the surface in each cell
    item_cell: int32 (i,), cell of each item, ascending
    points: float64 (i, 3), a point of each item on the surface
    directions: float64 (i, 3), outward normals of planes; directions of lines, of either sign
    is_line: bool (i,)
    starts: int64 (n + 1,), where the items of each cell begin
    tolerance: distance up to which items are the same
    same_angle: radians up to which items are the same
    agreement: share of items that must agree where the surface is the same; 1 for exact surfaces
    weak: bool (i,), items that may be missing where the surface is the same; None for none
    splats: whether triangles stand for points, one each; splats are never cut
    """

    corners: FloatArray
    faces: IntArray
    origin: FloatArray
    cell_size: float
    radius: float
    keys: np.ndarray
    cells: np.ndarray
    neighbours: IntArray
    area: FloatArray
    item_cell: IntArray
    points: FloatArray
    directions: FloatArray
    is_line: np.ndarray
    starts: np.ndarray
    tolerance: float
    same_angle: float = SAME_ANGLE_RADIANS
    agreement: float = 1.0
    weak: BoolArray | None = None
    splats: bool = False

    def __len__(self) -> int:
        return len(self.keys)

    @cached_property
    def items(self) -> GridItems:
        """What kernels look up."""
        return GridItems(
            self.origin,
            self.cell_size,
            self.keys,
            self.starts,
            self.points,
            self.directions,
            self.is_line,
            self.tolerance,
            self.same_angle,
        )

    @cached_property
    def bounds(self) -> FloatArray:
        """Lowest and highest corner of the box around the points of all items, float64 (2, 3)."""
        return np.stack([self.points.min(axis=0), self.points.max(axis=0)])

    @property
    def slack(self) -> float:
        """Allowed difference of shares on equal surfaces: 0 for exact ones."""
        return (1 - self.agreement) / 5

    def centres(self, cells: np.ndarray | slice = slice(None)) -> FloatArray:
        """Return the centres of cells, by their indices, float64 (m, 3)."""
        centres: FloatArray = self.origin + (self.cells[cells] + 0.5) * self.cell_size
        return centres


def surface_grid(corners: FloatArray, share: float) -> SurfaceGrid:
    """Build the grid of triangles (f, 3, 3) for a radius of `share` of the longest side of their box.

    Triangles without area are left out. A side of a triangle is a boundary where the triangle's plane ends. The
    connectivity of the mesh does not matter, so that T-junctions and duplicate triangles make no boundary.
    """
    faces = np.flatnonzero(has_area(corners))
    corners = np.ascontiguousarray(corners[faces])
    low = corners.min(axis=(0, 1))
    radius = share * float((corners.max(axis=(0, 1)) - low).max())
    size = radius / CELLS_PER_RADIUS
    origin = low - size * (np.array(LATTICE_OFFSET_CELLS) + 2)
    where, owner, middles = fragments(corners, origin, size)
    packed = pack_cells(where)
    order = np.argsort(packed, kind="stable")
    packed, owner, middles = packed[order], owner[order], middles[order]
    keys, first = np.unique(packed, return_index=True)
    cells = unpack_cells(keys)
    normals = unit_normals(corners)
    starts = np.append(first, len(packed))
    tolerance = SAME_POSITION_CELLS * size
    planes = _planes(starts, owner, middles, normals, tolerance)
    triangles = GridTriangles(corners, normals, origin, size, keys, starts, owner, tolerance)
    lines = boundary_lines(triangles, sides_that_go_on(corners, normals, size))
    item_cell, points, directions, is_line = _in_cell_order(planes, lines)
    return SurfaceGrid(
        corners=corners,
        faces=faces.astype(np.int32),
        origin=origin,
        cell_size=size,
        radius=radius,
        keys=keys,
        cells=cells,
        neighbours=neighbours_of(cells, keys),
        area=np.add.reduceat(middles[:, 3], first),
        item_cell=item_cell,
        points=points,
        directions=directions,
        is_line=is_line,
        starts=np.searchsorted(item_cell, np.arange(len(keys) + 1)),
        tolerance=tolerance,
    )


def estimate_grid_size(corners: FloatArray, radius: float) -> int:
    """Estimate how large a search for symmetries is: the number of triangles (f, 3, 3) with area and of their cells.

    radius: of similarity, as a share of the longest side. A plane at a random slant crosses 3/2 cells of a lattice for
    each square as wide as a cell.
    """
    corners = corners[has_area(corners)]
    if not len(corners):
        return 0
    size = radius / CELLS_PER_RADIUS * float(np.ptp(corners.reshape(-1, 3), axis=0).max())
    area = float(triangle_areas(corners).sum())
    return len(corners) + round(1.5 * area / size**2)


def has_area(corners: FloatArray) -> BoolArray:
    """Find the triangles (f, 3, 3) that have area, bool (f,)."""
    sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1)
    chosen: BoolArray = 2 * triangle_areas(corners) > MIN_HEIGHT_SHARE * sides**2
    return chosen


@numba.njit(cache=True)
def _planes(starts, owner, middles, normals, tolerance):
    """Return cell, point and normal of each plane of each cell; the point is that of its largest fragment."""
    cell, size = np.empty(len(owner), dtype=np.int64), np.empty(len(owner))
    points, directions = np.empty((len(owner), 3)), np.empty((len(owner), 3))
    total = 0
    for n in range(len(starts) - 1):
        begin = total
        for place in range(starts[n], starts[n + 1]):
            normal, middle = normals[owner[place]], middles[place]
            known = -1
            for item in range(begin, total):
                difference = normal - directions[item]
                if (difference * difference).sum() < SAME_ANGLE_RADIANS**2 and abs(
                    (normal * (middle[:3] - points[item])).sum()
                ) < tolerance:
                    known = item
                    break
            if known < 0:
                known, size[total] = total, -1.0
                cell[total], directions[total] = n, normal
                total += 1
            if middle[3] > size[known]:
                size[known], points[known] = middle[3], middle[:3]
    return cell[:total], points[:total], directions[:total]


def _in_cell_order(
    planes: tuple[np.ndarray, ...], lines: tuple[np.ndarray, ...]
) -> tuple[IntArray, FloatArray, FloatArray, np.ndarray]:
    """Join planes and lines to items in the order of their cells."""
    cell = np.concatenate([planes[0], lines[0]])
    order = np.argsort(cell, kind="stable")
    is_line = np.arange(len(cell)) >= len(planes[0])
    points, directions = np.concatenate([planes[1], lines[1]]), np.concatenate([planes[2], lines[2]])
    return cell[order].astype(np.int32), points[order], directions[order], is_line[order]
