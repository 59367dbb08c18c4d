"""Grids of k degrees of freedom: rows of pieces that can be longer or shorter, and cross (symmetry §3.4.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from stages.grammars.extraction.docked_pieces import DockedPiece
from stages.grammars.extraction.seams import Seam, cells_within_steps, cut_out, surface_recurs
from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.pose import rotation_angle, transform_points
from stages.symmetry.matching.cell_lookup import is_among
from stages.symmetry.surface.grid import SurfaceGrid
from stages.symmetry.surface.soup import Soup

CLEARANCE_STEPS = 2
"""Cells by which a piece of a row must lie inside the next."""
MIN_CELL_SHARE = 2e-3
"""Smallest share of the surface in a cell of a row."""
SAME_ROW_SHARE = 0.9
"""Rows that share more of their surface are the same row."""
MIN_TILED_SHARE = 0.99
"""Share of the cells of a row that must come to lie in the same cells of the other row, borders excepted."""


@dataclass(frozen=True)
class GridRow:
    """A 1-grid: docked pieces of one class, each in the one before it, that one transform takes to the next.

    docked_pieces: indices among the pieces of the exemplar, the largest first
    transform: float64 (4, 4), rigid
    """

    docked_pieces: tuple[int, ...]
    transform: FloatArray

    @property
    def count(self) -> int:
        """How often the exemplar has the cell."""
        return len(self.docked_pieces) - 1


@dataclass(frozen=True)
class ExtractedGrid:
    """Rows that cross, and the pieces into which they cut the exemplar, up to 3^k of them.

    transforms: float64 (k, 4, 4), from cell to cell of each row; they commute
    counts: cells of each row in the exemplar
    sites: class of each row's sites
    frames: float64 (k, 4, 4), of the first site of each row
    pieces: for each row 0, 1 or 2 as in GRID_PARTS, and the triangles of the piece, as in the exemplar, first in all
        rows
    """

    transforms: FloatArray
    counts: tuple[int, ...]
    sites: tuple[int, ...]
    frames: FloatArray
    pieces: tuple[tuple[tuple[int, ...], Soup], ...]


def find_one_grids(grid: SurfaceGrid, pieces: Sequence[DockedPiece], seams: dict[int, Seam]) -> list[GridRow]:
    """Find the 1-grids among docked pieces, those of most cells first: chains of insertions that undo deletions.

    A piece contains another one of its class, and the transform from site to site goes on. A row that equals another
    one from its other end, or at a multiple of its transform, is left out.
    """
    middles = [grid.origin + (grid.cells[piece.border].mean(axis=0) + 0.5) * grid.cell_size for piece in pieces]
    steps: dict[int, list[tuple[int, FloatArray]]] = {}
    for one, piece in enumerate(pieces):
        within = np.zeros(len(grid), dtype=bool)
        within[piece.cells] = True
        for other, transform in piece.ways:
            held = pieces[other]
            if held.area < piece.area - MIN_CELL_SHARE:
                around = cells_within_steps(grid, held.cells, CLEARANCE_STEPS)
                if not (around & ~within).any():
                    steps.setdefault(one, []).append((other, transform))
    rows: list[GridRow] = []
    for one, ways in steps.items():
        for other, transform in ways:
            chain, end = [one, other], other
            while (after := _next(steps.get(end, []), transform, middles[end], grid.cell_size)) is not None:
                chain.append(after)
                end = after
            frames = _frames(pieces[one].frame, transform, len(chain))
            if all(surface_recurs(grid, seams[pieces[one].site].band, frame) for frame in frames[1:]):
                rows.append(GridRow(tuple(chain), transform))
    return _distinct_rows(grid, pieces, rows)


def _distinct_rows(grid: SurfaceGrid, pieces: Sequence[DockedPiece], rows: Sequence[GridRow]) -> list[GridRow]:
    """Return the rows of most cells, without those that are the same row as an earlier one."""
    cells = [_cells(pieces, row) for row in rows]
    areas = [float(grid.area[own].sum()) for own in cells]
    order = sorted(
        range(len(rows)),
        key=lambda n: (
            -rows[n].count,
            round(float(rotation_angle(rows[n].transform)), 3),
            -areas[n],
            rows[n].docked_pieces,
        ),
    )
    kept: list[int] = []
    for new in order:
        if all(
            grid.area[cells[new][is_among(cells[old], cells[new])]].sum() < SAME_ROW_SHARE * min(areas[new], areas[old])
            for old in kept
        ):
            kept.append(new)
    return [rows[index] for index in kept]


def crossing_rows(grid: SurfaceGrid, pieces: Sequence[DockedPiece], rows: Sequence[GridRow]) -> list[tuple[int, ...]]:
    """Return the maximal sets of rows that cross each other, as indices among `rows`; a row that crosses none is one.

    Each set makes a grid with as many degrees of freedom as possible.
    """
    fits = np.zeros((len(rows), len(rows)), dtype=bool)
    labels = [_labels(grid, pieces, row) for row in rows]
    for one, other in combinations(range(len(rows)), 2):
        fits[one, other] = fits[other, one] = _tile(grid, pieces, rows, labels, one, other)
    sets: list[tuple[int, ...]] = []
    for size in range(len(rows), 0, -1):
        for chosen in combinations(range(len(rows)), size):
            if all(fits[pair] for pair in combinations(chosen, 2)) and not any(
                set(chosen) < set(known) for known in sets
            ):
                sets.append(chosen)
    return sets


def cut_grid(
    grid: SurfaceGrid, pieces: Sequence[DockedPiece], rows: Sequence[GridRow], seams: dict[int, Seam]
) -> ExtractedGrid:
    """Cut the exemplar along rows that cross, and keep one cell of each row."""
    parts: list[tuple[tuple[int, ...], Soup]] = [((), Soup(grid.corners, np.arange(len(grid.corners), dtype=np.int32)))]
    for row in rows:
        held = [pieces[row.docked_pieces[index]].cells for index in (0, 1, -1)]
        first = pieces[row.docked_pieces[0]]
        frames = _frames(first.frame, row.transform, len(row.docked_pieces))
        seam = seams[first.site]
        cut = []
        for along, soup in parts:
            inside, rest = cut_out(soup, grid, held[0], frames[0], seam)
            _, cell = cut_out(inside, grid, held[1], frames[1], seam)
            end, _ = cut_out(inside, grid, held[2], frames[-1], seam)
            cut += [((*along, part), piece) for part, piece in enumerate((rest, cell, end)) if len(piece)]
        parts = cut
    firsts = [pieces[row.docked_pieces[0]] for row in rows]
    return ExtractedGrid(
        transforms=np.array([row.transform for row in rows]),
        counts=tuple(row.count for row in rows),
        sites=tuple(piece.site for piece in firsts),
        frames=np.array([piece.frame for piece in firsts]),
        pieces=tuple(parts),
    )


def _frames(first: FloatArray, transform: FloatArray, count: int) -> list[FloatArray]:
    """Return where the pieces of a row dock, float64 (4, 4) each, by the transform of the row.

    The transform found for a site that is symmetric in itself may have turned another way.
    """
    return [np.linalg.matrix_power(transform, power) @ first for power in range(count)]


def _next(ways: Sequence[tuple[int, FloatArray]], transform: FloatArray, middle: FloatArray, size: float) -> int | None:
    """Return the piece to which the same transform goes on, or None."""
    for other, way in ways:
        if (
            np.abs(way[:3, :3] - transform[:3, :3]).max() < 1e-3
            and np.abs(transform_points(way, middle) - transform_points(transform, middle)).max() < size
        ):
            return other
    return None


def _cells(pieces: Sequence[DockedPiece], row: GridRow) -> IntArray:
    """Return the cells between the first piece of a row and its last."""
    held = pieces[row.docked_pieces[0]].cells
    between: IntArray = held[~is_among(pieces[row.docked_pieces[-1]].cells, held)]
    return between


def _labels(grid: SurfaceGrid, pieces: Sequence[DockedPiece], row: GridRow) -> IntArray:
    """Return how many pieces of a row each cell is in, int32 (n,)."""
    labels = np.zeros(len(grid), dtype=np.int32)
    for index in row.docked_pieces:
        labels[pieces[index].cells] += 1
    return labels


def _tile(
    grid: SurfaceGrid,
    pieces: Sequence[DockedPiece],
    rows: Sequence[GridRow],
    labels: Sequence[IntArray],
    one: int,
    other: int,
) -> bool:
    """Return whether two rows make a 2-grid.

    Their cells must overlap and their transforms commute. Each transform must take what the other row separates to what
    it separates in the same way, including the borders of cells.
    """
    shared = _cells(pieces, rows[one])
    shared = shared[is_among(_cells(pieces, rows[other]), shared)]
    if not len(shared):
        return False
    points = grid.centres(shared)
    forth = transform_points(rows[one].transform @ rows[other].transform, points)
    if np.abs(forth - transform_points(rows[other].transform @ rows[one].transform, points)).max() > grid.cell_size:
        return False
    return _keeps_labels(grid, pieces, rows[one], labels[one], labels[other]) and _keeps_labels(
        grid, pieces, rows[other], labels[other], labels[one]
    )


def _keeps_labels(
    grid: SurfaceGrid, pieces: Sequence[DockedPiece], row: GridRow, own: IntArray, other: IntArray
) -> bool:
    """Return whether the transform of a row takes its cells and their borders to the same places of another row."""
    inner = (other[grid.neighbours] == other[:, None]) | (grid.neighbours < 0)
    clear = inner.all(axis=1)
    tested = np.zeros(len(grid), dtype=bool)
    tested[(own >= 1) & (own < row.count)] = True
    for index in row.docked_pieces[:-1]:
        tested[pieces[index].border] = True
    points = grid.centres(tested & clear)
    reached = _nearest_labels(grid, transform_points(row.transform, points), other)
    return bool((reached == other[tested & clear]).mean() >= MIN_TILED_SHARE - grid.slack)


def _nearest_labels(grid: SurfaceGrid, points: FloatArray, labels: IntArray) -> IntArray:
    """Return the labels of the occupied cells that are nearest to points (n, 3)."""
    from scipy.spatial import KDTree

    nearest: IntArray = labels[KDTree(grid.cells).query((points - grid.origin) / grid.cell_size - 0.5)[1]]
    return nearest
