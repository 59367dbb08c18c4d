"""Elementary docking sites of a rigid transform, and the pieces that dock there (symmetry §3.2, §3.3)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numba
import numpy as np

from stages.shape.arrays import BoolArray, FloatArray, IntArray
from stages.shape.geometry.components import connected_components
from stages.symmetry.matching.cell_lookup import is_among, items_in
from stages.symmetry.surface.grid import SurfaceGrid
from stages.symmetry.surface.lattice import cell_index, cell_of

MAX_OVERHANG_SHARE = 0.02
"""Share of a piece that may lie outside another one that contains it: borders of cells do not move with pieces."""
MIN_EIGENVALUE_SHARE = 1e-4
"""Smallest eigenvalue, as a share of the largest, of an infinitesimal motion that does not slip."""
FREE_SLIPS = 3
"""A site with at least three slippable motions lies on a plane or a sphere, where a piece could dock anywhere."""
NOISE_SLANT_SHARE = 0.06
"""Share of the angle up to which planes are the same, by which noise may slant them."""

OperationKind = Literal["insert", "delete", "replace"]


@dataclass(frozen=True)
class DockingSite:
    """An elementary docking site with the two pieces that dock there.

    Where the secondary piece is cut out, the transformed primary piece fits.

    transform: float64 (4, 4)
    primary, secondary: int32, cells of the pieces, ascending
    border: int32, cells of the site, which the transform takes onto the site of the secondary piece
    kind: insert if the primary piece contains the secondary, delete if the secondary contains it, else replace
    slips: how many of six infinitesimal motions move the site along itself
    """

    transform: FloatArray
    primary: IntArray
    secondary: IntArray
    border: IntArray
    kind: OperationKind
    slips: int


def find_docking_sites(
    grid: SurfaceGrid, transform: FloatArray, kept: BoolArray, kept_back: BoolArray
) -> list[DockingSite]:
    """Find the elementary docking sites of a rigid transform (4, 4), in the order of their first cells.

    kept, kept_back: bool (n,), the `r_symmetric_cells` of the transform

    The regions that are not r-symmetric, of the surface and of its image, depend on each other. They do where the
    border of one is taken to the border of the other. All regions that depend on each other make one pair of pieces. A
    pair of all regions of both is no operation, because it moves the whole surface.
    """
    regions, regions_back = _regions(~kept, grid.neighbours), _regions(~kept_back, grid.neighbours)
    count, count_back = int(regions.max(initial=-1)) + 1, int(regions_back.max(initial=-1)) + 1
    if not kept.any() or not count or not count_back:
        return []
    links, border = _links(kept, regions, regions_back, grid.neighbours, transform, grid.items)
    of_region, of_image = _members(regions, count), _members(regions_back, count_back)
    of_border = _members(border[:, 1], count)
    sites = []
    for own, other in _dependent_regions(np.unique(links, axis=0), count, count_back):
        if len(own) == count and len(other) == count_back:
            continue
        primary = np.sort(np.concatenate([of_region[region] for region in own])).astype(np.int32)
        secondary = np.sort(np.concatenate([of_image[region] for region in other])).astype(np.int32)
        cells = np.unique(border[np.concatenate([of_border[region] for region in own]), 0]).astype(np.int32)
        kind = operation_kind(primary, secondary, grid.slack)
        sites.append(DockingSite(transform, primary, secondary, cells, kind, count_slippable_motions(grid, cells)))
    return sites


def connected_regions(grid: SurfaceGrid, chosen: BoolArray) -> list[IntArray]:
    """Return the connected regions of `chosen` cells, bool (n,): int32, ascending, in the order of their first."""
    regions = _regions(chosen, grid.neighbours)
    return [cells.astype(np.int32) for cells in _members(regions, int(regions.max(initial=-1)) + 1)]


def count_slippable_motions(grid: SurfaceGrid, cells: IntArray) -> int:
    """Count the independent infinitesimal motions of the surface in `cells` along itself (Gelfand and Guibas 2004).

    1 for a straight prism, 2 for a cylinder, 3 for a plane or a sphere, where a piece could dock anywhere.
    """
    near = np.unique(np.r_[cells, grid.neighbours[cells].ravel()])
    planes = items_in(grid, near[near >= 0])
    planes = planes[~grid.is_line[planes]]
    points, normals = grid.points[planes], grid.directions[planes]
    points = points - points.mean(axis=0)
    points = points / max(float(np.linalg.norm(points, axis=1).mean()), 1e-300)
    rows = np.column_stack([np.cross(points, normals), normals])
    values = np.linalg.eigvalsh(rows.T @ rows)
    least = max(MIN_EIGENVALUE_SHARE, (NOISE_SLANT_SHARE * grid.same_angle) ** 2)
    return int((values < least * values[-1]).sum())


def _members(region: np.ndarray, count: int) -> list[np.ndarray]:
    """Return the indices of each of `count` regions in `region`, int (n,), -1 for none."""
    order = np.argsort(region, kind="stable")
    return np.split(order, np.searchsorted(region[order], np.arange(count + 1)))[1:-1]


def operation_kind(primary: IntArray, secondary: IntArray, slack: float) -> OperationKind:
    """Return what replacing the piece of cells `secondary` by that of cells `primary` does.

    slack: share that may lie elsewhere for noise
    """
    shared = int(is_among(primary, secondary).sum())
    if len(secondary) < len(primary) and shared >= (1 - MAX_OVERHANG_SHARE - slack) * len(secondary):
        return "insert"
    if len(primary) < len(secondary) and shared >= (1 - MAX_OVERHANG_SHARE - slack) * len(primary):
        return "delete"
    return "replace"


@numba.njit(cache=True)
def _regions(chosen, neighbours):
    """Return the connected region of each chosen cell, numbered by first cells; -1 for other cells."""
    region = np.full(len(chosen), -1, dtype=np.int32)
    stack = np.empty(len(chosen), dtype=np.int64)
    count = 0
    for first in range(len(chosen)):
        if not chosen[first] or region[first] >= 0:
            continue
        region[first], stack[0], size = count, first, 1
        while size:
            size -= 1
            n = stack[size]
            for place in range(26):
                other = neighbours[n, place]
                if other >= 0 and chosen[other] and region[other] < 0:
                    region[other] = count
                    stack[size] = other
                    size += 1
        count += 1
    return region


@numba.njit(cache=True)
def _links(kept, regions, regions_back, neighbours, transform, items):
    """Link regions of the surface to regions of its image.

    Returns int64 (l, 2), pairs of a region and a region of the image whose borders the transform takes onto each other,
    and int64 (b, 2), pairs of an r-symmetric cell and a region next to it.
    """
    origin, size, keys, starts, points = items.origin, items.size, items.keys, items.starts, items.points
    links, border = [(0, 0) for _ in range(0)], [(0, 0) for _ in range(0)]
    at, cell = np.empty(3), np.empty(3, dtype=np.int64)
    for n in range(len(kept)):
        if not kept[n]:
            continue
        region = -1
        for place in range(26):
            other = neighbours[n, place]
            if other < 0 or kept[other] or regions[other] == region:
                continue
            region = regions[other]
            border.append((n, region))
            for item in range(starts[n], starts[n + 1]):
                for d in range(3):
                    at[d] = transform[d, 3]
                    for e in range(3):
                        at[d] += transform[d, e] * points[item, e]
                cell_of(at, origin, size, cell)
                home = cell_index(keys, cell[0], cell[1], cell[2])
                if home < 0:
                    continue
                for second in range(27):
                    middle = home if second == 26 else neighbours[home, second]
                    if middle < 0:
                        continue
                    if regions_back[middle] >= 0:
                        if len(links) == 0 or links[-1] != (region, regions_back[middle]):
                            links.append((region, regions_back[middle]))
                        continue
                    for third in range(26):
                        last = neighbours[middle, third]
                        if last < 0 or regions_back[last] < 0:
                            continue
                        if len(links) == 0 or links[-1] != (region, regions_back[last]):
                            links.append((region, regions_back[last]))
    pairs, border_pairs = np.empty((len(links), 2), dtype=np.int64), np.empty((len(border), 2), dtype=np.int64)
    for number in range(len(links)):
        pairs[number, 0], pairs[number, 1] = links[number]
    for number in range(len(border)):
        border_pairs[number, 0], border_pairs[number, 1] = border[number]
    return pairs, border_pairs


def _dependent_regions(links: np.ndarray, count: int, count_back: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the connected components of linked regions that have regions of the surface and of its image.

    links: int64 (l, 2); count, count_back: how many regions the surface and its image have
    """
    component = connected_components(count + count_back, links + np.array([0, count]))
    groups = _members(component, int(component.max(initial=-1)) + 1)
    split = [(group[group < count], group[group >= count] - count) for group in groups]
    return [(own, other) for own, other in split if len(own) and len(other)]
