"""Docking sites of all motions with their dockers; sites of one shape identified across the model (symmetry §3.4.2)."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from stages.grammars.extraction.continuation import corner_cells, maps_enough_corners, separated_cells
from stages.grammars.extraction.seams import cells_within_steps, surface_recurs
from stages.shape.arrays import BoolArray, FloatArray, IntArray
from stages.shape.geometry.pose import invert, rotation_angle, transform_points
from stages.symmetry.matching.docking_sites import (
    DockingSite,
    OperationKind,
    count_slippable_motions,
    find_docking_sites,
    operation_kind,
)
from stages.symmetry.matching.r_symmetry import (
    cells_within,
    erode_cells_twice,
    mutually_symmetric_cells,
    symmetric_cells,
)
from stages.symmetry.surface.grid import CELLS_PER_RADIUS, SurfaceGrid

SLIPPERY = 3
"""A site that slips in so many ways lies on a plane or a sphere, where a docker could stand anywhere."""
BEYOND = 1.0
"""Sites are looked for so many cells farther inside symmetric surface than the radius: under another motion the borders
of cells fall elsewhere, and a site at the very edge of one would be none of the other."""
LEAST = 2e-3
"""A docker of less than this share of the surface is not worth a cut."""
APART = 2.5
"""Sites are equal under a motion if their cells are at most so far apart once moved; unit: cells."""
WITHIN = 0.9
"""Share of the docker's cells along a site that must be in the other docker."""
STEP = 1e-2
"""Radians that a motion more weighs: of ways that turn as little the shorter is taken."""
MOST = 400
"""So many dockers are looked at, those of the most fruitful motions first."""
UNDOES: dict[OperationKind, OperationKind] = {"insert": "delete", "delete": "insert"}
"""What takes back an operation."""


@dataclass(frozen=True)
class DockedPiece:
    """A piece of the surface that a docking site parts from the rest.

    cells: int32, ascending; border: int32, the cells around it, all r-symmetric under the motion that it was found by.
    site: which sites are equal, by number; frame: float64 (4, 4), takes the first docker of the site's class to where
    this one docks. area: share of the whole surface. ways: the dockers to whose sites motions take this one's, by their
    places, each with the motion.
    """

    cells: IntArray
    border: IntArray
    area: float
    site: int = -1
    frame: FloatArray = field(default_factory=lambda: np.eye(4))
    ways: tuple[tuple[int, FloatArray], ...] = ()


def find_docked_pieces(grid: SurfaceGrid, motions: FloatArray) -> list[DockedPiece]:
    """The dockers of the elementary docking sites of rigid motions (m, 4, 4) and their inverses, each once, those of a
    class of sites together and the smallest first.

    A row goes on as far as its motion takes its sites. Made several times the motion may be none of those that are
    looked at: there are only so many, and turns and diagonals may carry more of the surface. But made so many times it
    must carry corners, as each candidate does. Sites that slip on the surface in three ways, where a docker could
    stand anywhere, are left out. Two sites are equal under a motion if the whole site is r-symmetric under it and comes
    to lie on the other, with the docker on one side.
    """
    kept: list[BoolArray] = []
    found = _Sites(grid)
    ends: list[tuple[int, int, OperationKind]] = []
    both = np.stack([each for one in motions for each in (one, invert(one))])
    for number, motion in enumerate(motions):
        forth, back = (erode_cells_twice(grid, each, BEYOND) for each in symmetric_cells(grid, motion))
        kept += [forth[0], back[0]]
        for site, primary, secondary in _of_motion(
            grid, motion, *mutually_symmetric_cells(grid, motion, forth[1], back[1])
        ):
            first, last = found.place_of(primary), found.place_of(secondary)
            if first is None or last is None or site.kind == "replace":
                continue
            ends += [(last, 2 * number, site.kind), (first, 2 * number + 1, UNDOES[site.kind])]
    corners = corner_cells(grid)
    for end, way, kind in ends:
        at: int | None = end
        whole = both[way]  # from the other docker of the site, and on to the next
        while at is not None and maps_enough_corners(grid, corners, whole := both[way] @ whole):
            docker = _next_in_row(grid, found.sites[at], both[way], kept[way], kind)
            at = None if docker is None else found.place_of(docker)
    return _identified(grid, found.sites, both, kept)


def surrounding_cells(grid: SurfaceGrid, cells: np.ndarray) -> IntArray:
    """The cells around `cells`, int32, ascending."""
    around = cells_within_steps(grid, cells, 1)
    around[cells] = False
    return np.flatnonzero(around).astype(np.int32)


def _of_motion(
    grid: SurfaceGrid, motion: FloatArray, kept: BoolArray, kept_back: BoolArray
) -> Iterator[tuple[DockingSite, DockedPiece, DockedPiece]]:
    """The elementary docking sites of a motion, each with its primary and its secondary docker."""
    for site in find_docking_sites(grid, motion, kept, kept_back):
        if site.slips >= SLIPPERY:
            continue
        pair = _docker(grid, site.primary), _docker(grid, site.secondary)
        # a site whose dockers are the same piece on both sides changes nothing; one without a border parts nothing
        if min(each.area for each in pair) < LEAST or not all(len(each.border) for each in pair):
            continue
        if all(count_slippable_motions(grid, each.border) < SLIPPERY for each in pair):
            yield site, *pair


def _docker(grid: SurfaceGrid, cells: IntArray) -> DockedPiece:
    return DockedPiece(cells, surrounding_cells(grid, cells), float(grid.area[cells].sum() / grid.area.sum()))


def _next_in_row(
    grid: SurfaceGrid, site: _Site, motion: FloatArray, symmetric: BoolArray, kind: OperationKind
) -> DockedPiece | None:
    """What a site parts where a motion (4, 4) takes it, if all around it is r-symmetric under that and it takes the
    place of the docker as `kind` says: in a row always with a cell more, or always with one less."""
    docker = site.docker
    if symmetric[docker.border].mean() < grid.agreement:
        return None
    cells = separated_cells(grid, docker.cells, docker.border, motion)
    if cells is None or operation_kind(docker.cells, cells, grid.slack) != kind:
        return None
    after = _docker(grid, cells)
    if min(after.area, abs(after.area - docker.area)) < LEAST or not len(after.border):
        return None
    return after if site.lies_on(_Site(grid, after), motion) else None


class _Sites:
    """Sites that are found, each once and at most MOST."""

    def __init__(self, grid: SurfaceGrid) -> None:
        self.sites: list[_Site] = []
        self._grid = grid

    def place_of(self, docker: DockedPiece) -> int | None:
        """Where the site of a docker is among them, put there if it is new; None where there is no room."""
        site = _Site(self._grid, docker)
        for place, each in enumerate(self.sites):
            if site.lies_on(each, np.eye(4)):
                return place
        if len(self.sites) == MOST:
            return None
        self.sites.append(site)
        return len(self.sites) - 1


class _Site:
    """The cells of a site, and those of its docker along it, as points to compare."""

    def __init__(self, grid: SurfaceGrid, docker: DockedPiece) -> None:
        self.docker = docker
        self._grid = grid
        self.around = _centres(grid, docker.border)
        self.middle: FloatArray = self.around.mean(axis=0)

    @cached_property
    def tree(self) -> Any:
        """The site's cells."""
        from scipy.spatial import KDTree

        return KDTree(self.around)

    @cached_property
    def rim(self) -> FloatArray:
        """Middles of the docker's cells within the radius of the site, float64 (m, 3): those right beside it would lie
        near those on its other side."""
        near = cells_within_steps(self._grid, self.docker.border, CELLS_PER_RADIUS)[self.docker.cells]
        return _centres(self._grid, self.docker.cells[near])

    @cached_property
    def rim_tree(self) -> Any:
        """The rim."""
        from scipy.spatial import KDTree

        return KDTree(self.rim)

    def lies_on(self, other: _Site, motion: FloatArray) -> bool:
        """Whether a motion takes this site to another one, with the docker on the same side."""
        from scipy.spatial import KDTree

        most = APART * self._grid.cell_size
        here = transform_points(motion, self.around)
        for end, there in ((here.min(axis=0), other.around.min(axis=0)), (here.max(axis=0), other.around.max(axis=0))):
            if (np.abs(end - there) > most).any():
                return False
        if np.isfinite(other.tree.query(here, distance_upper_bound=most)[0]).mean() < self._grid.agreement:
            return False
        if np.isfinite(KDTree(here).query(other.around, distance_upper_bound=most)[0]).mean() < self._grid.agreement:
            return False
        moved = transform_points(motion, self.rim)
        within = WITHIN * self._grid.agreement
        return bool(np.isfinite(other.rim_tree.query(moved, distance_upper_bound=most)[0]).mean() > within)


def _centres(grid: SurfaceGrid, cells: IntArray) -> FloatArray:
    found: FloatArray = grid.origin + (grid.cells[cells] + 0.5) * grid.cell_size
    return found


def _identified(grid: SurfaceGrid, sites: list[_Site], motions: FloatArray, kept: list[BoolArray]) -> list[DockedPiece]:
    """The dockers with their classes of sites, each class from its first docker on by motions that take one to the
    next."""
    found = [each.docker for each in sites]
    ways: list[list[tuple[int, FloatArray]]] = [[] for _ in found]
    middles = np.array([each.middle for each in sites]).reshape(-1, 3)
    for motion, symmetric in zip(motions, kept, strict=True):
        for one, docker in enumerate(found):
            if symmetric[docker.border].mean() < grid.agreement:
                continue
            away = np.linalg.norm(middles - transform_points(motion, middles[one]), axis=1)
            for other in np.flatnonzero(away <= 2 * APART * grid.cell_size).tolist():
                if other != one and sites[one].lies_on(sites[other], motion):
                    ways[one].append((other, motion))
                    ways[other].append((one, invert(motion)))
    frames: dict[int, tuple[int, FloatArray]] = {}
    site = 0
    for first in range(len(found)):
        if first in frames:
            continue
        # a site that is symmetric in itself is reached in several ways: by those that turn least
        around = cells_within(grid, found[first].border, grid.radius / grid.cell_size)
        waiting: list[tuple[float, int, int, FloatArray]] = [(0.0, 0, first, np.eye(4))]
        while waiting:
            turned, _, place, frame = heapq.heappop(waiting)
            if place in frames or (place != first and not surface_recurs(grid, around, frame)):
                continue
            frames[place] = (site, frame)
            for other, motion in ways[place]:
                if other not in frames:
                    turn = turned + STEP + round(float(rotation_angle(motion)), 3)
                    heapq.heappush(waiting, (turn, len(frames) * len(found) + len(waiting), other, motion @ frame))
        site += 1
    order = sorted(range(len(found)), key=lambda place: (frames[place][0], found[place].area))
    number = {old: new for new, old in enumerate(order)}
    return [
        replace(
            found[old],
            site=frames[old][0],
            frame=frames[old][1],
            ways=tuple((number[other], motion) for other, motion in ways[old]),
        )
        for old in order
    ]
