"""Docking sites of all motions with their dockers; sites of one shape identified across the model (symmetry §3.4.2)."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from stages.exemplars.symmetry.docking import docking_sites, slippable_motions
from stages.exemplars.symmetry.matching import cells_within, eroded_twice, mutual, symmetric_cells
from stages.exemplars.symmetry.seams import stands, widened
from stages.exemplars.symmetry.surface import CELLS_A_RADIUS, SurfaceGrid
from stages.shape.arrays import BoolArray, FloatArray, IntArray
from stages.shape.geometry.pose import invert, rotation_angle, transform_points

__all__ = ["SLIPPERY", "Docker", "beside", "dockers_of"]

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


@dataclass(frozen=True)
class Docker:
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


def dockers_of(grid: SurfaceGrid, motions: FloatArray) -> list[Docker]:
    """The dockers of the elementary docking sites of rigid motions (m, 4, 4) and their inverses, each once, those of a
    class of sites together and the smallest first.

    Sites that slip on the surface in three ways, where a docker could stand anywhere, are left out. Two sites are equal
    under a motion if the whole site is r-symmetric under it and comes to lie on the other, with the docker on one side.
    """
    kept: list[BoolArray] = []
    found: list[_Site] = []
    for motion in motions:
        forth, back = (eroded_twice(grid, each, BEYOND) for each in symmetric_cells(grid, motion))
        kept += [forth[0], back[0]]
        for docker in _of_motion(grid, motion, *mutual(grid, motion, forth[1], back[1])):
            site = _Site(grid, docker)
            if len(found) < MOST and not any(site.lies_on(each, np.eye(4)) for each in found):
                found.append(site)
    return _identified(grid, found, np.stack([each for one in motions for each in (one, invert(one))]), kept)


def beside(grid: SurfaceGrid, cells: np.ndarray) -> IntArray:
    """The cells around `cells`, int32, ascending."""
    around = widened(grid, cells, 1)
    around[cells] = False
    return np.flatnonzero(around).astype(np.int32)


def _of_motion(grid: SurfaceGrid, motion: FloatArray, kept: BoolArray, kept_back: BoolArray) -> Iterator[Docker]:
    """Both dockers of each elementary docking site of a motion."""
    whole = grid.area.sum()
    for site in docking_sites(grid, motion, kept, kept_back):
        if site.slips >= SLIPPERY:
            continue
        pair = [
            Docker(each, beside(grid, each), float(grid.area[each].sum() / whole))
            for each in (site.primary, site.secondary)
        ]
        # a site whose dockers are the same piece on both sides changes nothing; one without a border parts nothing
        if min(each.area for each in pair) < LEAST or not all(len(each.border) for each in pair):
            continue
        if all(slippable_motions(grid, each.border) < SLIPPERY for each in pair):
            yield from pair


class _Site:
    """The cells of a site, and those of its docker along it, as points to compare."""

    def __init__(self, grid: SurfaceGrid, docker: Docker) -> None:
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
        near = widened(self._grid, self.docker.border, CELLS_A_RADIUS)[self.docker.cells]
        return _centres(self._grid, self.docker.cells[near])

    @cached_property
    def rim_tree(self) -> Any:
        """The rim."""
        from scipy.spatial import KDTree

        return KDTree(self.rim)

    def lies_on(self, other: _Site, motion: FloatArray) -> bool:
        """Whether a motion takes this site to another one, with the docker on the same side."""
        from scipy.spatial import KDTree

        most = APART * self._grid.size
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
    found: FloatArray = grid.origin + (grid.cells[cells] + 0.5) * grid.size
    return found


def _identified(grid: SurfaceGrid, sites: list[_Site], motions: FloatArray, kept: list[BoolArray]) -> list[Docker]:
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
            for other in np.flatnonzero(away <= 2 * APART * grid.size).tolist():
                if other != one and sites[one].lies_on(sites[other], motion):
                    ways[one].append((other, motion))
                    ways[other].append((one, invert(motion)))
    frames: dict[int, tuple[int, FloatArray]] = {}
    site = 0
    for first in range(len(found)):
        if first in frames:
            continue
        # a site that is symmetric in itself is reached in several ways: by those that turn least
        around = cells_within(grid, found[first].border, grid.radius / grid.size)
        waiting: list[tuple[float, int, int, FloatArray]] = [(0.0, 0, first, np.eye(4))]
        while waiting:
            turned, _, place, frame = heapq.heappop(waiting)
            if place in frames or (place != first and not stands(grid, around, frame)):
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
