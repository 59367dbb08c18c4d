"""Triangle soups of the original surface, cut along the borders of cells (symmetry §4) or by planes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numba
import numpy as np

from stages.shape.arrays import BoolArray, FloatArray, IntArray
from stages.shape.geometry.components import connected_components
from stages.shape.geometry.pose import invert, transform_points
from stages.shape.geometry.triangles import triangle_areas
from stages.symmetry.matching.cell_lookup import is_among
from stages.symmetry.surface.clip import cut_triangles, fragments
from stages.symmetry.surface.grid import SurfaceGrid
from stages.symmetry.surface.lattice import cell_index, cell_keys, cell_of

BLOCK_CELLS = 4
"""Width of the blocks, in cells, by which triangles near the cut are found."""
BLOCK_MARGIN = 1e-3
"""Triangles count as near a block within this share of its width, so that rounding decides nothing."""
NEIGHBOUR_CELLS = 1.8
"""Cells are neighbours if their indices differ by less: sqrt(3) is the diagonal of a cell."""

MAX_AREA_DIFFERENCE = 1e-3
"""Share of their area by which equal pieces may differ: slivers where borders of cells meet old seams."""
PROBE_SHARE = 0.8
"""Position of the probe points on the way from the centre of a triangle to its corners."""


@dataclass(frozen=True)
class Soup:
    """Triangles of a mesh, or pieces of them.

    corners: float64 (t, 3, 3)
    faces: int32 (t,), the face of the mesh that each is part of
    """

    corners: FloatArray
    faces: IntArray

    def __len__(self) -> int:
        return len(self.faces)

    def select(self, chosen: np.ndarray) -> Soup:
        """Return the triangles that are `chosen`, bool (t,) or indices."""
        return Soup(self.corners[chosen], self.faces[chosen])

    @cached_property
    def areas(self) -> FloatArray:
        """Area of each triangle, float64 (t,)."""
        return triangle_areas(self.corners)

    @cached_property
    def area(self) -> float:
        """Area of all triangles."""
        return float(self.areas.sum())


@dataclass(frozen=True)
class PlanePair:
    """Two parallel planes, where `normal` times x equals `low` or `high`.

    normal: float64 (3,), unit length
    low, high: offsets, ascending
    """

    normal: FloatArray
    low: float
    high: float

    def moved(self, pose: FloatArray) -> PlanePair:
        """Return the planes moved by `pose` (4, 4)."""
        normal = pose[:3, :3] @ self.normal
        shift = float(normal @ pose[:3, 3])
        return PlanePair(normal, self.low + shift, self.high + shift)

    def cut(self, soup: Soup) -> tuple[Soup, Soup, Soup]:
        """Cut a soup by both planes; return the parts below, between and above."""
        below, rest = cut_by_plane(soup, self.normal, self.low)
        between, above = cut_by_plane(rest, self.normal, self.high)
        return below, between, above


def carve(
    soup: Soup, grid: SurfaceGrid, cells: IntArray, pose: FloatArray, planes: PlanePair | None = None
) -> tuple[Soup, Soup]:
    """Split a soup into what lies in cells of a grid moved by `pose` (4, 4), and the rest.

    cells: int32, indices of the cells, ascending. Triangles are cut where they leave the cells and nowhere else, so
    that both sides of a seam have the same border. Splats are not cut; they lie where their centres are.
    planes: moved by `pose` too; they cut through `cells`, and what is outside of them belongs to the rest.
    """
    if grid.splats:
        inside = centres_in(soup, grid, cells, pose)
        return soup.select(inside), soup.select(~inside)
    chosen = grid.cells[cells]
    box = np.array([chosen.min(axis=0), chosen.max(axis=0)])
    bounds = grid.origin + grid.cell_size * np.array([box[0], box[1] + 1])
    blocks = np.zeros((box[1] - box[0]) // BLOCK_CELLS + 1, dtype=bool)
    blocks[tuple(((chosen - box[0]) // BLOCK_CELLS).T)] = True
    back = invert(pose)
    near = _near_blocks(soup.corners, back, bounds[0], BLOCK_CELLS * grid.cell_size, blocks)
    if not len(near):
        return soup.select(near), soup
    if planes is not None:
        far = np.delete(np.arange(len(soup)), near)
        below, between, above = planes.moved(pose).cut(soup.select(near))
        kept, beside = carve(between, grid, cells, pose)
        return kept, join_soups(soup.select(far), below, above, beside)
    local = transform_points(back, soup.corners[near].reshape(-1, 3)).reshape(-1, 3, 3)
    where, owner, _ = fragments(local, grid.origin, grid.cell_size, box)
    inside = is_among(grid.keys[cells], cell_keys(where))
    held, total = np.bincount(owner[inside], minlength=len(near)), np.bincount(owner, minlength=len(near))
    whole = (held == total) & ((local >= bounds[0]) & (local <= bounds[1])).all(axis=(1, 2)) & (held > 0)
    crossing = (held > 0) & ~whole
    within = np.zeros(len(soup), dtype=bool)
    within[near[whole]] = True
    cut = near[crossing]
    of_crossing = crossing[owner]
    corners, side, source = cut_triangles(
        local[crossing],
        grid.origin,
        grid.cell_size,
        where[of_crossing],
        np.searchsorted(np.flatnonzero(crossing), owner[of_crossing]),
        inside[of_crossing],
        box,
    )
    corners = transform_points(pose, corners.reshape(-1, 3)).reshape(-1, 3, 3)
    untouched = ~within
    untouched[cut] = False
    pieces = Soup(corners, soup.faces[cut][source])
    return (
        join_soups(soup.select(within), pieces.select(side)),
        join_soups(soup.select(untouched), pieces.select(~side)),
    )


def cut_by_plane(soup: Soup, normal: FloatArray, offset: float) -> tuple[Soup, Soup]:
    """Cut triangles by the plane `normal` (3,) times x = `offset`; return the parts below and above."""
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


@numba.njit(cache=True)
def _near_blocks(corners, pose, low, size, blocks):
    """Return the indices of triangles (f, 3, 3) whose boxes, moved by `pose` (4, 4), come near a chosen block.

    low, size: corner (3,) and width of the first block; blocks: bool (i, j, k), the chosen ones.
    """
    near, total = np.empty(len(corners), dtype=np.int64), 0
    first, last = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    for face in range(len(corners)):
        for d in range(3):
            lowest, highest = np.inf, -np.inf
            for k in range(3):
                at = pose[d, 3]
                for e in range(3):
                    at += pose[d, e] * corners[face, k, e]
                lowest, highest = min(lowest, at), max(highest, at)
            first[d] = max(int(np.floor((lowest - low[d]) / size - BLOCK_MARGIN)), 0)
            last[d] = min(int(np.floor((highest - low[d]) / size + BLOCK_MARGIN)), blocks.shape[d] - 1)
        if _any_block(blocks, first, last):
            near[total] = face
            total += 1
    return near[:total].copy()


@numba.njit(cache=True)
def _any_block(blocks, first, last):
    """Return whether any of `blocks` bool (i, j, k) from `first` to `last` is chosen."""
    for i in range(first[0], last[0] + 1):
        for j in range(first[1], last[1] + 1):
            for k in range(first[2], last[2] + 1):
                if blocks[i, j, k]:
                    return True
    return False


def centres_in(soup: Soup, grid: SurfaceGrid, cells: IntArray, pose: FloatArray) -> BoolArray:
    """Find the triangles whose centres lie in ascending `cells` moved by `pose` (4, 4), bool (t,)."""
    chosen = grid.cells[cells]
    low, high = (chosen.min(axis=0), chosen.max(axis=0)) if len(chosen) else (np.zeros(3, int), np.full(3, -1))
    inside: BoolArray = _centres_in(
        soup.corners, invert(pose), grid.origin, grid.cell_size, grid.keys[cells], low, high
    )
    return inside


@numba.njit(cache=True)
def _centres_in(corners, pose, origin, size, keys, low, high):
    """Find the triangles (f, 3, 3) whose centres, moved by `pose` (4, 4), lie in one of some cells, bool (f,).

    keys: int64, packed cells, ascending; low, high: the lowest and the highest of them, int64 (3,).
    """
    inside = np.zeros(len(corners), dtype=np.bool_)
    at, cell = np.empty(3), np.empty(3, dtype=np.int64)
    for face in range(len(corners)):
        for d in range(3):
            at[d] = pose[d, 3]
            for e in range(3):
                at[d] += pose[d, e] * (corners[face, 0, e] + corners[face, 1, e] + corners[face, 2, e]) / 3
        cell_of(at, origin, size, cell)
        in_box = True
        for d in range(3):
            in_box &= low[d] <= cell[d] <= high[d]
        if in_box:
            inside[face] = cell_index(keys, cell[0], cell[1], cell[2]) >= 0
    return inside


def connected_soups(soup: Soup, origin: FloatArray, size: float) -> list[Soup]:
    """Split a soup into pieces that occupy no neighbouring cells of a lattice, in the order of their first triangles.

    origin, size: a corner (3,) of the lattice and the width of its cells.
    """
    from scipy.spatial import KDTree

    if not len(soup):
        return []
    where, owner, _ = fragments(soup.corners, origin, size)
    cells, place = np.unique(where, axis=0, return_inverse=True)
    pairs = KDTree(cells).query_pairs(NEIGHBOUR_CELLS, output_type="ndarray")
    component = connected_components(len(cells), pairs)
    piece = np.full(len(soup), -1)
    piece[owner] = component[place.reshape(-1)]
    order = list(dict.fromkeys(piece[piece >= 0].tolist()))
    return [soup.select(piece == number) for number in order]


def join_soups(*soups: Soup) -> Soup:
    """Return the triangles of some soups, one soup after another."""
    return Soup(np.concatenate([soup.corners for soup in soups]), np.concatenate([soup.faces for soup in soups]))


def soups_match(
    one: Soup, other: Soup, pose: FloatArray, tolerance: float, max_difference: float = MAX_AREA_DIFFERENCE
) -> bool:
    """Return whether `pose` (4, 4) maps one surface onto the other.

    max_difference: share of the area by which the two may differ

    The areas must agree. Probe points must lie within twice the tolerance of the other surface. The smallest triangles,
    which make up that share of the surface, have none.
    """
    from stages.shape.geometry.mesh_pairs import build_tree, points_on_surface

    if abs(one.area - other.area) > max_difference * one.area:
        return False
    for source, target, transform in ((one, other, pose), (other, one, invert(pose))):
        order = np.argsort(source.areas, kind="stable")
        large = source.corners[order[np.cumsum(source.areas[order]) > max_difference * source.area]]
        centres = large.mean(axis=1, keepdims=True)
        probes = np.concatenate([centres, centres + PROBE_SHARE * (large - centres)], axis=1).reshape(-1, 3)
        tree = build_tree(target.corners.reshape(-1, 3), np.arange(3 * len(target)).reshape(-1, 3).astype(np.int32))
        if not points_on_surface(*tree, probes @ transform[:3, :3].T + transform[:3, 3], 2 * tolerance):
            return False
    return True
