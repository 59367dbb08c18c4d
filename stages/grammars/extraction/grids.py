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

ROOM = 2
"""Cells by which a docker of a row must lie inside the next."""
LEAST = 2e-3
"""Share of the surface that a cell of a row has at least."""
SAME = 0.9
"""Share of the surface of two rows from which on they are the same row."""
TILED = 0.99
"""Share of the cells of a row that must come to lie in the same places of the other row, borders aside."""


@dataclass(frozen=True)
class GridRow:
    """A 1-grid: dockers of one class, each in the one before it, that one motion takes each to the next.

    dockers: places among the dockers of the exemplar, the largest first; motion: rigid (4, 4).
    """

    docked_pieces: tuple[int, ...]
    transform: FloatArray

    @property
    def count(self) -> int:
        """How often the exemplar has the cell."""
        return len(self.docked_pieces) - 1


@dataclass(frozen=True)
class ExtractedGrid:
    """Rows that cross, and the pieces that they cut the exemplar into, up to 3^k of them.

    motions: float64 (k, 4, 4), which commute; counts: of the exemplar; sites: of each row the class of its sites, and
    frames float64 (k, 4, 4) where the first of them stands. pieces: for each row 0, 1 or 2 as in ENDS, and pieces of
    the surface's triangles, as the exemplar has them first along all rows.
    """

    transforms: FloatArray
    counts: tuple[int, ...]
    sites: tuple[int, ...]
    frames: FloatArray
    pieces: tuple[tuple[tuple[int, ...], Soup], ...]


def find_rows(grid: SurfaceGrid, dockers: Sequence[DockedPiece], seams: dict[int, Seam]) -> list[GridRow]:
    """The 1-grids among dockers, those of most cells first: chains of insertions that undo deletions.

    A docker holds another of its class, and the motion from site to site goes on. What is the same row from its other
    end, or the row at a multiple of its motion, is left out.
    """
    middles = [grid.origin + (grid.cells[each.border].mean(axis=0) + 0.5) * grid.cell_size for each in dockers]
    steps: dict[int, list[tuple[int, FloatArray]]] = {}
    for one, docker in enumerate(dockers):
        within = np.zeros(len(grid), dtype=bool)
        within[docker.cells] = True
        for other, motion in docker.ways:
            held = dockers[other]
            if held.area < docker.area - LEAST and not (cells_within_steps(grid, held.cells, ROOM) & ~within).any():
                steps.setdefault(one, []).append((other, motion))
    found: list[GridRow] = []
    for one, ways in steps.items():
        for other, motion in ways:
            chain, place = [one, other], other
            while (after := _next(steps.get(place, []), motion, middles[place], grid.cell_size)) is not None:
                chain.append(after)
                place = after
            first = _frames(dockers[one].frame, motion, len(chain))
            if all(surface_recurs(grid, seams[dockers[one].site].band, frame) for frame in first[1:]):
                found.append(GridRow(tuple(chain), motion))
    cells = [_cells(dockers, each) for each in found]
    areas = [float(grid.area[each].sum()) for each in cells]
    order = sorted(
        range(len(found)),
        key=lambda n: (
            -found[n].count,
            round(float(rotation_angle(found[n].transform)), 3),
            -areas[n],
            found[n].docked_pieces,
        ),
    )
    kept: list[int] = []
    for new in order:
        if all(
            grid.area[cells[new][is_among(cells[old], cells[new])]].sum() < SAME * min(areas[new], areas[old])
            for old in kept
        ):
            kept.append(new)
    return [found[each] for each in kept]


def crossing_rows(grid: SurfaceGrid, dockers: Sequence[DockedPiece], rows: Sequence[GridRow]) -> list[tuple[int, ...]]:
    """The sets of rows that make grids of as many degrees of freedom as there can be, each as places among `rows`: rows
    that cross nothing alone."""
    fits = np.zeros((len(rows), len(rows)), dtype=bool)
    labels = [_labels(grid, dockers, each) for each in rows]
    for one, other in combinations(range(len(rows)), 2):
        fits[one, other] = fits[other, one] = _tile(grid, dockers, rows, labels, one, other)
    found: list[tuple[int, ...]] = []
    for size in range(len(rows), 0, -1):
        for chosen in combinations(range(len(rows)), size):
            if all(fits[pair] for pair in combinations(chosen, 2)) and not any(
                set(chosen) < set(each) for each in found
            ):
                found.append(chosen)
    return found


def cut_grid(
    grid: SurfaceGrid, dockers: Sequence[DockedPiece], rows: Sequence[GridRow], seams: dict[int, Seam]
) -> ExtractedGrid:
    """The pieces of a grid of rows that cross: what all of them cut the exemplar into, a cell of each row once."""
    pieces: list[tuple[tuple[int, ...], Soup]] = [
        ((), Soup(grid.corners, np.arange(len(grid.corners), dtype=np.int32)))
    ]
    for row in rows:
        held = [dockers[row.docked_pieces[place]].cells for place in (0, 1, -1)]
        frames = _frames(dockers[row.docked_pieces[0]].frame, row.transform, len(row.docked_pieces))
        seam = seams[dockers[row.docked_pieces[0]].site]
        cut = []
        for where, soup in pieces:
            inside, rest = cut_out(soup, grid, held[0], frames[0], seam)
            _, cell = cut_out(inside, grid, held[1], frames[1], seam)
            end, _ = cut_out(inside, grid, held[2], frames[-1], seam)
            cut += [((*where, place), each) for place, each in enumerate((rest, cell, end)) if len(each)]
        pieces = cut
    first = [dockers[each.docked_pieces[0]] for each in rows]
    return ExtractedGrid(
        transforms=np.array([each.transform for each in rows]),
        counts=tuple(each.count for each in rows),
        sites=tuple(each.site for each in first),
        frames=np.array([each.frame for each in first]),
        pieces=tuple(pieces),
    )


def _frames(first: FloatArray, motion: FloatArray, count: int) -> list[FloatArray]:
    """Where the dockers of a row dock, float64 (4, 4) each, by the motion of the row: that to a site which is symmetric
    in itself may have turned another way."""
    return [np.linalg.matrix_power(motion, place) @ first for place in range(count)]


def _next(ways: Sequence[tuple[int, FloatArray]], motion: FloatArray, middle: FloatArray, size: float) -> int | None:
    """The docker to which the same motion goes on, if there is one."""
    for other, way in ways:
        if (
            np.abs(way[:3, :3] - motion[:3, :3]).max() < 1e-3
            and np.abs(transform_points(way, middle) - transform_points(motion, middle)).max() < size
        ):
            return other
    return None


def _cells(dockers: Sequence[DockedPiece], row: GridRow) -> IntArray:
    """The cells between the first docker of a row and its last."""
    held = dockers[row.docked_pieces[0]].cells
    found: IntArray = held[~is_among(dockers[row.docked_pieces[-1]].cells, held)]
    return found


def _labels(grid: SurfaceGrid, dockers: Sequence[DockedPiece], row: GridRow) -> IntArray:
    """How many dockers of a row each cell is in, int32 (n,)."""
    labels = np.zeros(len(grid), dtype=np.int32)
    for each in row.docked_pieces:
        labels[dockers[each].cells] += 1
    return labels


def _tile(
    grid: SurfaceGrid,
    dockers: Sequence[DockedPiece],
    rows: Sequence[GridRow],
    labels: Sequence[IntArray],
    one: int,
    other: int,
) -> bool:
    """Whether two rows make a 2-grid: their cells overlap, their motions commute, and each motion takes what the other
    row parts to what it parts in the same way, borders of cells too."""
    shared = _cells(dockers, rows[one])
    shared = shared[is_among(_cells(dockers, rows[other]), shared)]
    if not len(shared):
        return False
    points = grid.origin + (grid.cells[shared] + 0.5) * grid.cell_size
    forth = transform_points(rows[one].transform @ rows[other].transform, points)
    if np.abs(forth - transform_points(rows[other].transform @ rows[one].transform, points)).max() > grid.cell_size:
        return False
    return _keeps(grid, dockers, rows[one], labels[one], labels[other]) and _keeps(
        grid, dockers, rows[other], labels[other], labels[one]
    )


def _keeps(grid: SurfaceGrid, dockers: Sequence[DockedPiece], row: GridRow, own: IntArray, other: IntArray) -> bool:
    """Whether the motion of a row takes each cell of it, and the borders of these, to the next, in the same places of
    another row."""
    inner = (other[grid.neighbours] == other[:, None]) | (grid.neighbours < 0)
    clear = inner.all(axis=1)
    asked = np.zeros(len(grid), dtype=bool)
    asked[(own >= 1) & (own < row.count)] = True
    for docker in row.docked_pieces[:-1]:
        asked[dockers[docker].border] = True
    points = grid.origin + (grid.cells[asked & clear] + 0.5) * grid.cell_size
    there = _nearest_labels(grid, transform_points(row.transform, points), other)
    return bool((there == other[asked & clear]).mean() >= TILED - grid.slack)


def _nearest_labels(grid: SurfaceGrid, points: FloatArray, labels: IntArray) -> IntArray:
    """The labels of the occupied cells that are nearest to points (n, 3)."""
    from scipy.spatial import KDTree

    found: IntArray = labels[KDTree(grid.cells).query((points - grid.origin) / grid.cell_size - 0.5)[1]]
    return found
