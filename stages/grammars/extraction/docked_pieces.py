"""Docking sites of all rigid transforms with their pieces; equal sites are identified across the model
(symmetry §3.4.2)."""

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
    FREE_SLIPS,
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

EXTRA_EROSION_CELLS = 1.0
"""Sites are searched this much farther, in cells, inside symmetric surface than the radius.

Under another transform the borders of cells fall elsewhere, and a site at the very edge would be none there.
"""
MIN_PIECE_SHARE = 2e-3
"""A docked piece of less than this share of the surface is not worth a cut."""
MAX_SITE_DISTANCE_CELLS = 2.5
"""Sites are equal under a transform if their transformed cells are no farther from each other, in cells."""
MIN_SHARED_RIM = 0.9
"""Share of a piece's cells along a site that must be in the other piece."""
STEP_COST_RADIANS = 1e-2
"""Cost of one transform more: of ways that turn equally the one with fewer transforms is taken."""
MAX_PIECES = 400
"""Docked pieces that are looked at, those of the most fruitful transforms first."""
INVERSE_KIND: dict[OperationKind, OperationKind] = {"insert": "delete", "delete": "insert"}
"""The operation that undoes another one."""


@dataclass(frozen=True)
class DockedPiece:
    """A piece of the surface that a docking site separates from the rest (symmetry §3.2).

    cells: int32, ascending
    border: int32, cells around it, all r-symmetric under the transform by which it was found
    area: share of the whole surface
    site: class of its site; equal sites have one class
    frame: float64 (4, 4), from where the first piece of the class docks to where this one docks
    ways: indices of the pieces to whose sites transforms take this one's, each with the transform (4, 4)
    """

    cells: IntArray
    border: IntArray
    area: float
    site: int = -1
    frame: FloatArray = field(default_factory=lambda: np.eye(4))
    ways: tuple[tuple[int, FloatArray], ...] = ()


def find_docked_pieces(grid: SurfaceGrid, transforms: FloatArray) -> list[DockedPiece]:
    """Find the pieces at elementary docking sites of rigid transforms (m, 4, 4) and their inverses.

    Each piece is listed once, by class of its site and then by size. A row goes on as far as its transform takes its
    sites. A power of the transform need not be one of the candidates, which are few, because turns and diagonals may
    carry more of the surface. But it must carry corners, as each candidate does. Sites that slip on the surface in
    three ways, where a piece could dock anywhere, are left out. Two sites are equal under a transform if the whole site
    is r-symmetric under it and maps onto the other. The pieces must lie on the same side.
    """
    kept: list[BoolArray] = []
    known = _Sites(grid)
    ends: list[tuple[int, int, OperationKind]] = []
    both = np.stack([way for transform in transforms for way in (transform, invert(transform))])
    for number, transform in enumerate(transforms):
        symmetric = symmetric_cells(grid, transform)
        forth, back = (erode_cells_twice(grid, cells, EXTRA_EROSION_CELLS) for cells in symmetric)
        kept += [forth[0], back[0]]
        mutual = mutually_symmetric_cells(grid, transform, forth[1], back[1])
        for site, primary, secondary in _sites_of_transform(grid, transform, *mutual):
            first, last = known.index_of(primary), known.index_of(secondary)
            if site.kind == "replace":
                continue
            if first is None or last is None:
                continue
            ends += [(last, 2 * number, site.kind), (first, 2 * number + 1, INVERSE_KIND[site.kind])]
    corners = corner_cells(grid)
    for end, way, kind in ends:
        at: int | None = end
        whole = both[way]  # from the other piece of the site, and on to the next
        while at is not None and maps_enough_corners(grid, corners, whole := both[way] @ whole):
            piece = _next_in_row(grid, known.sites[at], both[way], kept[way], kind)
            at = None if piece is None else known.index_of(piece)
    return _identified(grid, known.sites, both, kept)


def surrounding_cells(grid: SurfaceGrid, cells: np.ndarray) -> IntArray:
    """Return the neighbours of `cells` that are not among them, int32, ascending."""
    around = cells_within_steps(grid, cells, 1)
    around[cells] = False
    return np.flatnonzero(around).astype(np.int32)


def _sites_of_transform(
    grid: SurfaceGrid, transform: FloatArray, kept: BoolArray, kept_back: BoolArray
) -> Iterator[tuple[DockingSite, DockedPiece, DockedPiece]]:
    """Yield the elementary docking sites of a transform, each with its primary and its secondary piece."""
    for site in find_docking_sites(grid, transform, kept, kept_back):
        if site.slips >= FREE_SLIPS:
            continue
        pair = _docked_piece(grid, site.primary), _docked_piece(grid, site.secondary)
        # a site whose pieces are the same on both sides changes nothing; one without a border separates nothing
        if min(piece.area for piece in pair) < MIN_PIECE_SHARE or not all(len(piece.border) for piece in pair):
            continue
        if all(count_slippable_motions(grid, piece.border) < FREE_SLIPS for piece in pair):
            yield site, *pair


def _docked_piece(grid: SurfaceGrid, cells: IntArray) -> DockedPiece:
    return DockedPiece(cells, surrounding_cells(grid, cells), float(grid.area[cells].sum() / grid.area.sum()))


def _next_in_row(
    grid: SurfaceGrid, site: _Site, transform: FloatArray, symmetric: BoolArray, kind: OperationKind
) -> DockedPiece | None:
    """Return the piece that a site separates at its transformed position, or None.

    kind: how the new piece relates to the old one; in a row each has one cell more, or each one less

    All around the site must be r-symmetric.
    """
    piece = site.piece
    if symmetric[piece.border].mean() < grid.agreement:
        return None
    cells = separated_cells(grid, piece.cells, piece.border, transform)
    if cells is None or operation_kind(piece.cells, cells, grid.slack) != kind:
        return None
    after = _docked_piece(grid, cells)
    if min(after.area, abs(after.area - piece.area)) < MIN_PIECE_SHARE or not len(after.border):
        return None
    return after if site.lies_on(_Site(grid, after), transform) else None


class _Sites:
    """Known sites, each once, at most MAX_PIECES."""

    def __init__(self, grid: SurfaceGrid) -> None:
        self.sites: list[_Site] = []
        self._grid = grid

    def index_of(self, piece: DockedPiece) -> int | None:
        """Return the index of a piece's site, added if it is new; None where there is no room."""
        site = _Site(self._grid, piece)
        for index, known in enumerate(self.sites):
            if site.lies_on(known, np.eye(4)):
                return index
        if len(self.sites) == MAX_PIECES:
            return None
        self.sites.append(site)
        return len(self.sites) - 1


class _Site:
    """The cells of a site, and those of its piece along it, as points to compare."""

    def __init__(self, grid: SurfaceGrid, piece: DockedPiece) -> None:
        self.piece = piece
        self._grid = grid
        self.around = grid.centres(piece.border)
        self.middle: FloatArray = self.around.mean(axis=0)

    @cached_property
    def tree(self) -> Any:
        """The centres of the site's cells."""
        from scipy.spatial import KDTree

        return KDTree(self.around)

    @cached_property
    def rim(self) -> FloatArray:
        """Centres of the piece's cells within the radius of the site, float64 (m, 3).

        Cells right next to the site alone would lie near those on its other side.
        """
        near = cells_within_steps(self._grid, self.piece.border, CELLS_PER_RADIUS)[self.piece.cells]
        return self._grid.centres(self.piece.cells[near])

    @cached_property
    def rim_tree(self) -> Any:
        """The rim."""
        from scipy.spatial import KDTree

        return KDTree(self.rim)

    def lies_on(self, other: _Site, transform: FloatArray) -> bool:
        """Return whether a transform takes this site to another one, with the piece on the same side."""
        from scipy.spatial import KDTree

        limit = MAX_SITE_DISTANCE_CELLS * self._grid.cell_size
        moved = transform_points(transform, self.around)
        for own, target in (
            (moved.min(axis=0), other.around.min(axis=0)),
            (moved.max(axis=0), other.around.max(axis=0)),
        ):
            if (np.abs(own - target) > limit).any():
                return False
        if np.isfinite(other.tree.query(moved, distance_upper_bound=limit)[0]).mean() < self._grid.agreement:
            return False
        if np.isfinite(KDTree(moved).query(other.around, distance_upper_bound=limit)[0]).mean() < self._grid.agreement:
            return False
        rim = transform_points(transform, self.rim)
        shared = np.isfinite(other.rim_tree.query(rim, distance_upper_bound=limit)[0]).mean()
        return bool(shared > MIN_SHARED_RIM * self._grid.agreement)


def _identified(
    grid: SurfaceGrid, sites: list[_Site], transforms: FloatArray, kept: list[BoolArray]
) -> list[DockedPiece]:
    """Return the pieces with the classes of their sites.

    Each class begins with its first piece and grows by the transforms that take one site to the next.
    """
    pieces = [site.piece for site in sites]
    ways: list[list[tuple[int, FloatArray]]] = [[] for _ in pieces]
    middles = np.array([site.middle for site in sites]).reshape(-1, 3)
    for transform, symmetric in zip(transforms, kept, strict=True):
        for one, piece in enumerate(pieces):
            if symmetric[piece.border].mean() < grid.agreement:
                continue
            distance = np.linalg.norm(middles - transform_points(transform, middles[one]), axis=1)
            for other in np.flatnonzero(distance <= 2 * MAX_SITE_DISTANCE_CELLS * grid.cell_size).tolist():
                if other != one and sites[one].lies_on(sites[other], transform):
                    ways[one].append((other, transform))
                    ways[other].append((one, invert(transform)))
    frames: dict[int, tuple[int, FloatArray]] = {}
    site_class = 0
    for first in range(len(pieces)):
        if first in frames:
            continue
        # a site that is symmetric in itself is reached in several ways: the one that turns least is taken
        around = cells_within(grid, pieces[first].border, grid.radius / grid.cell_size)
        waiting: list[tuple[float, int, int, FloatArray]] = [(0.0, 0, first, np.eye(4))]
        while waiting:
            turned, _, index, frame = heapq.heappop(waiting)
            if index in frames or (index != first and not surface_recurs(grid, around, frame)):
                continue
            frames[index] = (site_class, frame)
            for other, transform in ways[index]:
                if other not in frames:
                    turn = turned + STEP_COST_RADIANS + round(float(rotation_angle(transform)), 3)
                    tie = len(frames) * len(pieces) + len(waiting)
                    heapq.heappush(waiting, (turn, tie, other, transform @ frame))
        site_class += 1
    order = sorted(range(len(pieces)), key=lambda index: (frames[index][0], pieces[index].area))
    number = {old: new for new, old in enumerate(order)}
    return [
        replace(
            pieces[old],
            site=frames[old][0],
            frame=frames[old][1],
            ways=tuple((number[other], transform) for other, transform in ways[old]),
        )
        for old in order
    ]
