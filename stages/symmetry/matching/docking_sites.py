"""Elementary docking sites and dockers of a motion (symmetry §3.2, §3.3)."""

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

SAME_SET = 0.02
"""Share of a docker by which another may reach beyond it and count as inside: borders of cells do not move with it."""
SLIPPERY = 1e-4
"""Least eigenvalue, as a share of the largest, of a motion that does not slip."""
SLANTED = 0.06
"""By this share of the radians up to which planes are one they may be slanted by noise."""
AROUND = 2
"""Borders of two regions that are equal under a motion are at most so many cells apart, once moved."""

OperationKind = Literal["insert", "delete", "replace"]


@dataclass(frozen=True)
class DockingSite:
    """An elementary docking site with its two dockers.

    motion: float64 (4, 4); primary, secondary: cells of the dockers, int32, ascending; border: cells of the site, which
    the motion takes onto the site of the secondary docker. Where the secondary docker is cut out, the moved primary
    one fits. kind: insert where the primary contains the secondary, delete where it is contained in it, else replace.
    slips: how many of six infinitesimal motions move the site along itself.
    """

    transform: FloatArray
    primary: IntArray
    secondary: IntArray
    border: IntArray
    kind: OperationKind
    slips: int


def find_docking_sites(
    grid: SurfaceGrid, motion: FloatArray, kept: BoolArray, kept_back: BoolArray
) -> list[DockingSite]:
    """The elementary docking sites of `motion` (4, 4), in the order of their first cells; `kept` and `kept_back` are
    its `r_symmetric_cells`.

    Regions that are not r-symmetric, of the surface and of its image, depend on each other where the border of one is
    taken to the border of the other; what depends on each other is one pair of dockers. A pair that takes in all
    regions of both is no operation: it moves the whole surface.
    """
    regions, regions_back = _regions(~kept, grid.neighbours), _regions(~kept_back, grid.neighbours)
    count, count_back = int(regions.max(initial=-1)) + 1, int(regions_back.max(initial=-1)) + 1
    if not kept.any() or not count or not count_back:
        return []
    links, border = _links(
        kept,
        regions,
        regions_back,
        grid.neighbours,
        grid.points,
        grid.starts,
        motion,
        grid.origin,
        grid.cell_size,
        grid.keys,
    )
    of_region, of_image = _members(regions, count), _members(regions_back, count_back)
    of_border = _members(border[:, 1], count)
    sites = []
    for own, other in _dependent(np.unique(links, axis=0), count, count_back):
        if len(own) == count and len(other) == count_back:
            continue
        primary = np.sort(np.concatenate([of_region[each] for each in own])).astype(np.int32)
        secondary = np.sort(np.concatenate([of_image[each] for each in other])).astype(np.int32)
        cells = np.unique(border[np.concatenate([of_border[each] for each in own]), 0]).astype(np.int32)
        sites.append(
            DockingSite(
                motion,
                primary,
                secondary,
                cells,
                operation_kind(primary, secondary, grid.slack),
                count_slippable_motions(grid, cells),
            )
        )
    return sites


def connected_regions(grid: SurfaceGrid, chosen: BoolArray) -> list[IntArray]:
    """The connected regions of `chosen` cells, bool (n,), int32 each and ascending, in the order of their first."""
    regions = _regions(chosen, grid.neighbours)
    return [each.astype(np.int32) for each in _members(regions, int(regions.max(initial=-1)) + 1)]


def count_slippable_motions(grid: SurfaceGrid, cells: IntArray) -> int:
    """How many independent infinitesimal motions take the surface in `cells` along itself (Gelfand and Guibas 2004).

    1 for a straight prism, 2 for a cylinder, 3 for a plane or a sphere: there a docker could stand anywhere.
    """
    near = np.unique(np.r_[cells, grid.neighbours[cells].ravel()])
    there = items_in(grid, near[near >= 0])
    there = there[~grid.is_line[there]]
    points, normals = grid.points[there], grid.directions[there]
    points = points - points.mean(axis=0)
    points = points / max(float(np.linalg.norm(points, axis=1).mean()), 1e-300)
    rows = np.column_stack([np.cross(points, normals), normals])
    values = np.linalg.eigvalsh(rows.T @ rows)
    return int((values < max(SLIPPERY, (SLANTED * grid.same_angle) ** 2) * values[-1]).sum())


def _members(region: np.ndarray, count: int) -> list[np.ndarray]:
    """The places of each of `count` regions in `region`, int (n,), -1 for none."""
    order = np.argsort(region, kind="stable")
    return np.split(order, np.searchsorted(region[order], np.arange(count + 1)))[1:-1]


def operation_kind(primary: IntArray, secondary: IntArray, slack: float) -> OperationKind:
    """What it is to put the docker of cells `primary` where that of cells `secondary` is, int32 (n,) each. slack: share
    that may lie elsewhere for noise."""
    shared = int(is_among(primary, secondary).sum())
    if len(secondary) < len(primary) and shared >= (1 - SAME_SET - slack) * len(secondary):
        return "insert"
    if len(primary) < len(secondary) and shared >= (1 - SAME_SET - slack) * len(primary):
        return "delete"
    return "replace"


@numba.njit(cache=True)
def _regions(chosen, neighbours):
    """The connected region of each chosen cell, numbered by their first cells; -1 for the others."""
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
def _links(kept, regions, regions_back, neighbours, points, starts, motion, origin, size, keys):
    """Pairs (region, region of the image) whose borders the motion takes onto each other, and pairs (cell, region) of
    r-symmetric cells beside regions."""
    links, border = [(0, 0) for _ in range(0)], [(0, 0) for _ in range(0)]
    at, cell = np.empty(3), np.empty(3, dtype=np.int64)
    for n in range(len(kept)):
        if not kept[n]:
            continue
        beside = -1
        for place in range(26):
            other = neighbours[n, place]
            if other < 0 or kept[other] or regions[other] == beside:
                continue
            beside = regions[other]
            border.append((n, beside))
            for item in range(starts[n], starts[n + 1]):
                for d in range(3):
                    at[d] = motion[d, 3]
                    for e in range(3):
                        at[d] += motion[d, e] * points[item, e]
                cell_of(at, origin, size, cell)
                home = cell_index(keys, cell[0], cell[1], cell[2])
                if home < 0:
                    continue
                for second in range(27):
                    middle = home if second == 26 else neighbours[home, second]
                    if middle < 0:
                        continue
                    if regions_back[middle] >= 0:
                        if len(links) == 0 or links[-1] != (beside, regions_back[middle]):
                            links.append((beside, regions_back[middle]))
                        continue
                    for third in range(26):
                        last = neighbours[middle, third]
                        if last < 0 or regions_back[last] < 0:
                            continue
                        if len(links) == 0 or links[-1] != (beside, regions_back[last]):
                            links.append((beside, regions_back[last]))
    pairs, cells = np.empty((len(links), 2), dtype=np.int64), np.empty((len(border), 2), dtype=np.int64)
    for place in range(len(links)):
        pairs[place, 0], pairs[place, 1] = links[place]
    for place in range(len(border)):
        cells[place, 0], cells[place, 1] = border[place]
    return pairs, cells


def _dependent(links: np.ndarray, count: int, count_back: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Connected components of the graph of regions, `count` of the surface and `count_back` of its image; those with
    regions of both."""
    component = connected_components(count + count_back, links + np.array([0, count]))
    groups = _members(component, int(component.max(initial=-1)) + 1)
    split = [(each[each < count], each[each >= count] - count) for each in groups]
    return [(own, other) for own, other in split if len(own) and len(other)]
