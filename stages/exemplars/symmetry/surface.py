"""A surface on a sparse voxel grid: in each cell the planes and the boundary lines of its triangles (symmetry §4)."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from stages.exemplars.symmetry.clip import cell_of, fragments
from stages.shape.arrays import BoolArray, FloatArray, IntArray

__all__ = ["SAME_ANGLE", "SurfaceGrid", "cell_index", "pack", "surface_grid", "with_area"]

CELLS_A_RADIUS = 4
"""Cells have a quarter of the radius of similarity (symmetry §4)."""
SAME_PLACE = 1e-2
"""Planes and lines closer than this share of a cell are one."""
SAME_ANGLE = 5e-3
"""Radians up to which directions are one."""
ACROSS = 2e-3
"""So far beyond a side of a triangle, as a share of a cell, its plane must go on for the side to be no boundary."""
ALONG = (0.5, 0.1, 0.9)
"""Where along a piece of a side this is asked: in a sharp corner most of them lie beyond another side too."""
THIN = 1e-7
"""A triangle whose height is below this share of its longest side has no area."""
SHIFT = (0.3819660113, 0.2360679775, 0.1458980338)
"""Where in its cell the lowest corner lies: planes of models stand at round numbers, borders of cells should not."""
_BITS = 21


@dataclass(frozen=True)
class SurfaceGrid:
    """Occupied cells of a cubic lattice in ascending order of `keys`, with what lies in them.

    corners: float64 (f, 3, 3), triangles with area; faces: int32 (f,), their place in the mesh.
    keys: int64 (n,), packed cells; cells: int64 (n, 3); neighbours: int32 (n, 26), -1 where a neighbour is empty;
    area: float64 (n,). Items are planes (`is_line` False, `directions` outward normals) and boundary lines
    (`directions` along them, either way): item_cell int32 (i,) ascending, points float64 (i, 3) on the surface,
    directions float64 (i, 3), is_line bool (i,); starts int64 (n + 1,) of each cell's items.
    radius: of similarity; size: of a cell.
    """

    corners: FloatArray
    faces: IntArray
    origin: FloatArray
    size: float
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

    def __len__(self) -> int:
        return len(self.keys)

    @property
    def tolerance(self) -> float:
        """Distance up to which planes and lines are one."""
        return SAME_PLACE * self.size


def surface_grid(corners: FloatArray, share: float) -> SurfaceGrid:
    """The grid of triangles `corners` (f, 3, 3) for a radius of `share` of their box's longest side.

    Triangles without area are left out, of however many sides of a sliver that is the height. A side of a triangle is a
    boundary where the triangle's plane does not go on beyond it, whatever the mesh's connectivity: so T-junctions and
    doublets make none.
    """
    faces = np.flatnonzero(with_area(corners))
    corners = np.ascontiguousarray(corners[faces])
    low = corners.min(axis=(0, 1))
    radius = share * float((corners.max(axis=(0, 1)) - low).max())
    size = radius / CELLS_A_RADIUS
    origin = low - size * (np.array(SHIFT) + 2)
    where, owner, middles = fragments(corners, origin, size)
    packed = pack(where)
    order = np.argsort(packed, kind="stable")
    packed, owner, middles = packed[order], owner[order], middles[order]
    keys, first = np.unique(packed, return_index=True)
    cells = np.column_stack([keys >> 2 * _BITS, keys >> _BITS & (1 << _BITS) - 1, keys & (1 << _BITS) - 1])
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    starts = np.append(first, len(packed))
    tolerance = SAME_PLACE * size
    planes = _planes(starts, owner, middles, normals, tolerance)
    lines = _lines(corners, normals, origin, size, keys, starts, owner, tolerance)
    item_cell, points, directions, is_line = _joined(planes, lines)
    return SurfaceGrid(
        corners=corners,
        faces=faces.astype(np.int32),
        origin=origin,
        size=size,
        radius=radius,
        keys=keys,
        cells=cells,
        neighbours=_neighbours(cells, keys),
        area=np.add.reduceat(middles[:, 3], first),
        item_cell=item_cell,
        points=points,
        directions=directions,
        is_line=is_line,
        starts=np.searchsorted(item_cell, np.arange(len(keys) + 1)),
    )


def with_area(corners: FloatArray) -> BoolArray:
    """Which of triangles (f, 3, 3) have area, bool (f,)."""
    sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1)
    doubled = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    found: BoolArray = doubled > THIN * sides**2
    return found


def pack(cells: np.ndarray) -> np.ndarray:
    """Cells int64 (n, 3), none negative, as one number each, int64 (n,), in lexicographic order."""
    packed: np.ndarray = (cells[:, 0] << 2 * _BITS) | (cells[:, 1] << _BITS) | cells[:, 2]
    return packed


@numba.njit(cache=True)
def cell_index(keys, i, j, k):
    """The place of a cell among `keys`, -1 where it is empty."""
    if min(i, j, k) < 0:
        return -1
    key = (i << 42) | (j << 21) | k
    low, high = 0, len(keys)
    while low < high:
        middle = (low + high) // 2
        if keys[middle] < key:
            low = middle + 1
        else:
            high = middle
    return low if low < len(keys) and keys[low] == key else -1


@numba.njit(cache=True)
def _neighbours(cells, keys):
    found = np.empty((len(cells), 26), dtype=np.int32)
    for n in range(len(cells)):
        place = 0
        for x in range(-1, 2):
            for y in range(-1, 2):
                for z in range(-1, 2):
                    if x != 0 or y != 0 or z != 0:
                        found[n, place] = cell_index(keys, cells[n, 0] + x, cells[n, 1] + y, cells[n, 2] + z)
                        place += 1
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


@numba.njit(cache=True)
def _covered(point, normal, corners, normals, origin, size, keys, starts, owner, tolerance, cell):
    """Whether a triangle of this normal lies at a point."""
    cell_of(point, origin, size, cell)
    n = cell_index(keys, cell[0], cell[1], cell[2])
    if n < 0:
        return False
    for place in range(starts[n], starts[n + 1]):
        face = owner[place]
        other = normals[face]
        apart = normal - other
        if (apart * apart).sum() > SAME_ANGLE**2:
            continue
        if abs((other * (point - corners[face, 0])).sum()) > tolerance:
            continue
        within = True
        for k in range(3):
            a, b = corners[face, k], corners[face, (k + 1) % 3]
            e0, e1, e2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
            d0, d1, d2 = point[0] - a[0], point[1] - a[1], point[2] - a[2]
            area = other[0] * (e1 * d2 - e2 * d1) + other[1] * (e2 * d0 - e0 * d2) + other[2] * (e0 * d1 - e1 * d0)
            if area < -ACROSS / 10 * size * np.sqrt(e0 * e0 + e1 * e1 + e2 * e2):
                within = False
                break
        if within:
            return True
    return False


@numba.njit(cache=True)
def _lines(corners, normals, origin, size, keys, starts, owner, tolerance):
    """Cell, point, direction and length of each piece of a boundary, cut by the cells, not yet merged."""
    room = 4 * len(corners) + 16
    cell, points, directions, lengths = (
        np.empty(room, dtype=np.int64),
        np.empty((room, 3)),
        np.empty((room, 3)),
        np.empty(room),
    )
    total = 0
    here, beyond, times = np.empty(3, dtype=np.int64), np.empty(3), np.empty(64)
    for face in range(len(corners)):
        for k in range(3):
            start, way = corners[face, k], corners[face, (k + 1) % 3] - corners[face, k]
            length = np.sqrt((way * way).sum())
            if length <= tolerance:
                continue
            count = 2
            for axis in range(3):
                one, two = start[axis], start[axis] + way[axis]
                count += abs(int(np.floor((two - origin[axis]) / size)) - int(np.floor((one - origin[axis]) / size)))
            if count > len(times):
                times = np.empty(2 * count)
            times[0], times[1] = 0.0, 1.0
            filled = 2
            for axis in range(3):
                one, two = start[axis], start[axis] + way[axis]
                low, high = (
                    np.floor((min(one, two) - origin[axis]) / size),
                    np.floor((max(one, two) - origin[axis]) / size),
                )
                for border in range(int(low) + 1, int(high) + 1):
                    times[filled] = (origin[axis] + border * size - one) / (two - one)
                    filled += 1
            times[:filled].sort()
            outward = np.cross(way / length, normals[face])
            for piece in range(filled - 1):
                if (times[piece + 1] - times[piece]) * length <= tolerance:
                    continue
                goes_on = False
                for share in ALONG:
                    at = start + way * (times[piece] + share * (times[piece + 1] - times[piece]))
                    beyond[:] = at + ACROSS * size * outward
                    goes_on = goes_on or _covered(
                        beyond, normals[face], corners, normals, origin, size, keys, starts, owner, tolerance, here
                    )
                if goes_on:
                    continue
                middle = start + way * (times[piece] + times[piece + 1]) / 2
                cell_of(middle, origin, size, here)
                n = cell_index(keys, here[0], here[1], here[2])
                if n < 0:
                    continue
                if total == len(cell):
                    cell = np.append(cell, np.empty_like(cell))
                    lengths = np.append(lengths, np.empty_like(lengths))
                    points = np.concatenate((points, np.empty_like(points)))
                    directions = np.concatenate((directions, np.empty_like(directions)))
                cell[total], points[total], directions[total] = n, middle, way / length
                lengths[total] = (times[piece + 1] - times[piece]) * length
                total += 1
    order = np.argsort(cell[:total], kind="mergesort")
    return _merged(cell[order], points[order], directions[order], lengths[order], tolerance)


@numba.njit(cache=True)
def _merged(cell, points, directions, lengths, tolerance):
    """Lines of one cell that are one, once, each at the point of its longest piece."""
    total, begin = 0, 0
    for place in range(len(cell)):
        if total == 0 or cell[place] != cell[total - 1]:
            begin = total
        point, along, length, home = points[place].copy(), directions[place].copy(), lengths[place], cell[place]
        known = -1
        for item in range(begin, total):
            off = np.cross(along, directions[item])
            if (off * off).sum() < SAME_ANGLE**2:
                apart = np.cross(point - points[item], directions[item])
                if (apart * apart).sum() < tolerance**2:
                    known = item
                    break
        if known < 0:
            known = total
            total += 1
            cell[known], lengths[known] = home, -1.0
        if length > lengths[known]:
            lengths[known], points[known], directions[known] = length, point, along
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
