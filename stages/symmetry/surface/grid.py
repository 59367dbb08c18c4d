"""A surface on a sparse voxel grid: in each cell the planes and the boundary lines of its triangles (symmetry §4)."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from stages.shape.arrays import BoolArray, FloatArray, IntArray
from stages.shape.geometry.triangles import triangle_areas, unit_normals
from stages.symmetry.surface.boundary_lines import SAME_ANGLE, boundary_lines, sides_that_go_on
from stages.symmetry.surface.clip import fragments
from stages.symmetry.surface.lattice import neighbours_of, pack, unpack

CELLS_PER_RADIUS = 4
"""Cells have a quarter of the radius of similarity (symmetry §4)."""
SAME_PLACE = 1e-2
"""Planes and lines closer than this share of a cell are one."""
THIN = 1e-7
"""A triangle whose height is below this share of its longest side has no area."""
SHIFT = (0.3819660113, 0.2360679775, 0.1458980338)
"""Where in its cell the lowest corner lies: planes of models stand at round numbers, borders of cells should not."""


@dataclass(frozen=True)
class SurfaceGrid:
    """Occupied cells of a cubic lattice in ascending order of `keys`, with what lies in them.

    corners: float64 (f, 3, 3), triangles with area; faces: int32 (f,), their place in the mesh.
    keys: int64 (n,), packed cells; cells: int64 (n, 3); neighbours: int32 (n, 26), -1 where a neighbour is empty;
    area: float64 (n,). Items are planes (`is_line` False, `directions` outward normals) and boundary lines
    (`directions` along them, either way): item_cell int32 (i,) ascending, points float64 (i, 3) on the surface,
    directions float64 (i, 3), is_line bool (i,); starts int64 (n + 1,) of each cell's items.
    radius: of similarity; size: of a cell. tolerance, same_angle: distance and radians up to which planes and lines are
    one; agreement: share of items that must agree where a surface is the same, 1 for exact ones. weak: bool (i,),
    items that may be missing where a surface is the same, if there are any. splats: whether
    triangles stand for points, one each, so that none is ever cut.
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
    same_angle: float = SAME_ANGLE
    agreement: float = 1.0
    weak: BoolArray | None = None
    splats: bool = False

    def __len__(self) -> int:
        return len(self.keys)

    @property
    def slack(self) -> float:
        """By so much shares of surfaces may differ that are the same: 0 for exact ones."""
        return (1 - self.agreement) / 5


def surface_grid(corners: FloatArray, share: float) -> SurfaceGrid:
    """The grid of triangles `corners` (f, 3, 3) for a radius of `share` of their box's longest side.

    Triangles without area are left out, of however many sides of a sliver that is the height. A side of a triangle is a
    boundary where the triangle's plane does not go on beyond it, whatever the mesh's connectivity: so T-junctions and
    doublets make none.
    """
    faces = np.flatnonzero(has_area(corners))
    corners = np.ascontiguousarray(corners[faces])
    low = corners.min(axis=(0, 1))
    radius = share * float((corners.max(axis=(0, 1)) - low).max())
    size = radius / CELLS_PER_RADIUS
    origin = low - size * (np.array(SHIFT) + 2)
    where, owner, middles = fragments(corners, origin, size)
    packed = pack(where)
    order = np.argsort(packed, kind="stable")
    packed, owner, middles = packed[order], owner[order], middles[order]
    keys, first = np.unique(packed, return_index=True)
    cells = unpack(keys)
    normals = unit_normals(corners)
    starts = np.append(first, len(packed))
    tolerance = SAME_PLACE * size
    planes = _planes(starts, owner, middles, normals, tolerance)
    goes_on = sides_that_go_on(corners, normals, size)
    lines = boundary_lines(corners, normals, origin, size, keys, starts, owner, tolerance, goes_on)
    item_cell, points, directions, is_line = _joined(planes, lines)
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
    """How many triangles (f, 3, 3) have area, and about how many cells they lie in, for a radius as a share of the
    longest side. A plane at a random slant crosses 3/2 cells of a lattice for each square as wide as a cell."""
    corners = corners[has_area(corners)]
    if not len(corners):
        return 0
    size = radius / CELLS_PER_RADIUS * float(np.ptp(corners.reshape(-1, 3), axis=0).max())
    area = float(triangle_areas(corners).sum())
    return len(corners) + round(1.5 * area / size**2)


def has_area(corners: FloatArray) -> BoolArray:
    """Which of triangles (f, 3, 3) have area, bool (f,)."""
    sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1)
    found: BoolArray = 2 * triangle_areas(corners) > THIN * sides**2
    return found


@numba.njit(cache=True)
def _planes(starts, owner, middles, normals, tolerance):
    """Cell, point and normal of each plane of each cell; of a plane's fragments the largest says the point."""
    cell, size = np.empty(len(owner), dtype=np.int64), np.empty(len(owner))
    points, directions = np.empty((len(owner), 3)), np.empty((len(owner), 3))
    total = 0
    for n in range(len(starts) - 1):
        begin = total
        for place in range(starts[n], starts[n + 1]):
            normal, middle = normals[owner[place]], middles[place]
            known = -1
            for item in range(begin, total):
                apart = normal - directions[item]
                if (apart * apart).sum() < SAME_ANGLE**2 and abs(
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


def _joined(
    planes: tuple[np.ndarray, ...], lines: tuple[np.ndarray, ...]
) -> tuple[IntArray, FloatArray, FloatArray, np.ndarray]:
    """Planes and lines as items in the order of their cells."""
    cell = np.concatenate([planes[0], lines[0]])
    order = np.argsort(cell, kind="stable")
    is_line = np.arange(len(cell)) >= len(planes[0])
    points, directions = np.concatenate([planes[1], lines[1]]), np.concatenate([planes[2], lines[2]])
    return cell[order].astype(np.int32), points[order], directions[order], is_line[order]
