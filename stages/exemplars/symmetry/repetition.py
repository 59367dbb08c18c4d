"""1-grids: what a surface repeats, from operations that insert or delete it (symmetry §3.4.3)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from stages.exemplars.symmetry.docking import DockingSite, docking_sites
from stages.exemplars.symmetry.matching import matched_items
from stages.exemplars.symmetry.motions import candidate_motions
from stages.exemplars.symmetry.places import items_in, items_moved_into, keys_at
from stages.exemplars.symmetry.surface import SurfaceGrid
from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.pose import invert, transform_points

__all__ = ["PART", "Repetition", "repetitions"]

MOTIONS = 40
"""So many motions are looked at for docking sites, of a grid of many cells fewer."""
WORK = 16_000_000
"""Cells that are looked at in all, each once for a motion."""
PART = 2e-3
"""A part costs so much of the whole surface: copies of less are never worth a cut."""
SLIPPERY = 3
"""A site that slips in so many ways lies on a plane or a sphere, where a docker could stand anywhere."""
EQUAL = 0.999
"""Share of a copy that must be found, and of what is found that must be in the copy."""
ANOTHER = 0.3
"""A copy that shares more of its cells with the first is the first again: a turn comes round."""
POWERS = (-4, -3, -2, -1, 1, 2, 3, 4)
"""Multiples of a motion that are looked at."""
BAND = 3
"""Cells by which a region reaches beyond its far border, so that the copy after it sets that border."""


@dataclass(frozen=True)
class Repetition:
    """A 1-grid of the surface.

    motion: float64 (4, 4), from one copy to the next; cells: int32, of one copy, between its docking site and the moved
    one, and band: int32, these and some beyond the moved one: a copy is what lies in its band and not in the next
    copy's, so that all have one border. copies: exponents of the motion, ascending, 0 among them, at which the surface
    has the copy; area: of one.
    """

    motion: FloatArray
    cells: IntArray
    band: IntArray
    copies: tuple[int, ...]
    area: float

    def pose(self, copy: int) -> FloatArray:
        """The motion (4, 4) from the first copy to another."""
        power: FloatArray = np.linalg.matrix_power(self.motion if copy >= 0 else invert(self.motion), abs(copy))
        return power

    def moves_like(self, other: Repetition, grid: SurfaceGrid) -> bool:
        """Whether its motion, or the inverse, is a multiple of another's."""
        corners = transform_points(self.motion, grid.corners[:, 0])
        return any(
            float(np.linalg.norm(transform_points(other.pose(power), grid.corners[:, 0]) - corners, axis=1).max())
            < grid.size
            for power in POWERS
        )


def repetitions(grid: SurfaceGrid) -> list[Repetition]:
    """The 1-grids of at least two copies, that which saves most surface first.

    What an insertion adds is what the primary docker has more than the secondary, and the other way around for a
    deletion; it recurs as far as the surface has copies of it.
    """
    found = [
        each
        for motion in candidate_motions(grid, min(MOTIONS, max(1, WORK // len(grid))))
        for site in docking_sites(grid, motion)
        for each in _repetition(grid, site)
    ]
    return sorted(found, key=lambda each: -(len(each.copies) - 1) * each.area)


def _repetition(grid: SurfaceGrid, site: DockingSite) -> Iterator[Repetition]:
    if site.kind == "replace" or site.slips >= SLIPPERY:
        return
    more, less = (site.primary, site.secondary) if site.kind == "insert" else (site.secondary, site.primary)
    cells = np.setdiff1d(more, less, assume_unique=True).astype(np.int32)
    area = float(grid.area[cells].sum())
    if area <= PART * grid.area.sum():
        return
    allowed = np.full(len(grid), site.kind == "delete")
    allowed[more if site.kind == "insert" else less] = site.kind == "insert"
    band = cells
    for _ in range(BAND):
        around = np.unique(np.r_[band, grid.neighbours[band].ravel()])
        band = around[(around >= 0) & allowed[around]].astype(np.int32)
    alone = Repetition(site.motion, cells, band, (0,), area)
    up, down = _reach(grid, alone, 1), _reach(grid, alone, -1)
    if up + down:
        yield Repetition(site.motion, cells, band, tuple(range(-down, up + 1)), alone.area)


def _reach(grid: SurfaceGrid, repetition: Repetition, step: int) -> int:
    """How many copies follow one another in one direction: no more than the surface has room for."""
    items = items_in(grid, repetition.cells)
    keys = grid.keys[repetition.cells]
    room = int(grid.area.sum() / repetition.area)
    count = 0
    while count < room:
        pose = repetition.pose(step * (count + 1))
        if np.isin(keys_at(grid, pose, grid.points[items]), keys).mean() > ANOTHER:
            break
        if matched_items(grid, pose, items).mean() < EQUAL:
            break
        if matched_items(grid, invert(pose), items_moved_into(grid, repetition.cells, pose)).mean() < EQUAL:
            break
        count += 1
    return count
