"""A surface cut into repeated pieces and the rest between them: parts for a mesh that has none."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.pose import invert, transform_points
from stages.symmetry.matching.repetitions import PART_COST, Repetition, find_repetitions
from stages.symmetry.rows import chunks_along, find_row
from stages.symmetry.surface.clip import fragments
from stages.symmetry.surface.grid import SurfaceGrid, surface_grid
from stages.symmetry.surface.soup import NEIGHBOUR_CELLS, Soup, carve, connected_soups, join_soups, soups_match

RADIUS_SHARE = 0.016
"""Radius of similarity, as a share of the longest side of the model's box (symmetry §5)."""
MAX_TRIED_REPETITIONS = 10
MAX_COST_RATIO = 0.98
"""Cuts must lower the cost at least by this factor."""
MIN_PART_SHARE = 5e-4
"""A piece that touches no other is a part if it is more than this share of the surface."""
MAX_ROUNDS = 3
"""How often the largest single piece is searched again: rows hide others that save less."""
MAX_CHUNK_DIFFERENCE = 0.3
"""Share of their surface by which chunks along a row may differ; they lie less than a cell from each other."""
ROUNDING_SHARE = 1e-7
"""Pieces of less than this share of the surface are rounding errors."""


@dataclass(frozen=True)
class SurfacePiece:
    """A piece of the surface and all its copies.

    triangles: in the world, at the first pose
    poses: float64 (4, 4) each, rigid, the identity first
    strain: largest relative difference of surface between the chunks that run along the row of this piece
    """

    triangles: Soup
    poses: tuple[FloatArray, ...]
    strain: float = 0.0


def repeated_pieces(vertices: FloatArray, faces: IntArray) -> list[SurfacePiece]:
    """Cut a mesh, vertices (v, 3) and faces (f, 3), between the copies of what repeats.

    Equal pieces are one, with all their poses; a mesh without repetition is one piece. The repetition that saves most
    is taken first, as long as distinct pieces lose more than PART_COST of the surface each. Two repetitions that cross
    cut the pieces of a 2-grid. Triangles without area are left out.
    """
    corners = vertices[faces]
    grid = surface_grid(corners, RADIUS_SHARE)
    whole = Soup(grid.corners, grid.faces)
    pieces, cost = [SurfacePiece(whole, (np.eye(4),))], 1.0 + PART_COST
    for turn in range(MAX_ROUNDS):
        single = [piece for piece in pieces if len(piece.poses) == 1]
        largest = max(single, key=lambda piece: piece.triangles.area, default=None)
        if largest is None or not len(largest.triangles):
            break
        before = cost
        others = [piece for piece in pieces if piece is not largest]
        pieces, cost = _searched(
            largest, others, grid if turn == 0 else _grid_of_piece(grid, largest), whole.area, cost
        )
        if cost == before:
            break
    if len(pieces) == 1:
        return pieces
    for index in range(len(pieces)):
        pieces = _with_chunks_along_row(pieces, index, grid)
    return [part for part in _parts(pieces, grid) if part.triangles.area > ROUNDING_SHARE * whole.area]


def _grid_of_piece(grid: SurfaceGrid, piece: SurfacePiece) -> SurfaceGrid:
    """Build a grid of one piece, with cells as large as those of `grid`."""
    corners = piece.triangles.corners
    return surface_grid(corners, grid.radius / float(np.ptp(corners.reshape(-1, 3), axis=0).max()))


def _searched(
    piece: SurfacePiece, others: list[SurfacePiece], grid: SurfaceGrid, whole_area: float, cost: float
) -> tuple[list[SurfacePiece], float]:
    """Cut a piece by what it repeats; return it with the other pieces, and the cost of all.

    The repetition that lowers the cost most comes first. One that does not lower it is not tried again.
    """
    pieces = [piece]
    waiting = find_repetitions(grid)[:MAX_TRIED_REPETITIONS]
    while waiting:
        cuts = [[part for known in pieces for part in _cut(known, grid, repetition)] for repetition in waiting]
        prices = [_price([*others, *cut], whole_area) for cut in cuts]
        best = int(np.argmin(prices))
        if prices[best] >= MAX_COST_RATIO * cost:
            break
        waiting = [waiting[n] for n in range(len(waiting)) if n != best and prices[n] < MAX_COST_RATIO * cost]
        pieces, cost = cuts[best], prices[best]
    return [*others, *pieces], cost


def _price(pieces: list[SurfacePiece], whole_area: float) -> float:
    """Return the cost of pieces: their surface without copies, as a share of the whole, and PART_COST for each copy."""
    area = sum(piece.triangles.area for piece in pieces)
    return area / whole_area + PART_COST * sum(len(piece.poses) for piece in pieces)


def _cut(piece: SurfacePiece, grid: SurfaceGrid, repetition: Repetition) -> list[SurfacePiece]:
    """Cut a piece along the copies of a repetition; copies of equal shape are one piece."""
    rest = piece.triangles
    cut: list[tuple[SurfacePiece, FloatArray]] = []
    for pose in repetition.poses:
        inside, rest = carve(rest, grid, repetition.band, pose, repetition.planes)
        if repetition.ahead is not None and repetition.planes is None:
            beyond, inside = carve(inside, grid, repetition.band, pose @ repetition.ahead)
            rest = join_soups(rest, beyond)
        if inside.area <= ROUNDING_SHARE * grid.area.sum():
            continue
        for number, (known, first) in enumerate(cut):
            transform = pose @ invert(first)
            if soups_match(known.triangles, inside, transform, grid.tolerance):
                poses = (*known.poses, *(pose @ transform for pose in piece.poses))
                cut[number] = SurfacePiece(known.triangles, poses), first
                break
        else:
            cut.append((SurfacePiece(inside, piece.poses), pose))
    copies = [known for known, _ in cut]
    return [*copies, SurfacePiece(rest, piece.poses)] if len(rest) else copies


def _with_chunks_along_row(pieces: list[SurfacePiece], index: int, grid: SurfaceGrid) -> list[SurfacePiece]:
    """Give a piece that makes a row the chunks of other pieces that run along the row.

    The pieces stay as they are without such a row, or where the chunks of its copies are not about the same. A cable
    next to a mast hangs freely: the chunk of the first copy replaces those that lie within a cell of it.
    """
    piece = pieces[index]
    row = find_row(piece.poses, grid.tolerance)
    if row is None:
        return pieces
    changed = list(pieces)
    gained, strain = piece.triangles, piece.strain
    for other, single in enumerate(pieces):
        if other == index or len(single.poses) > 1:
            continue
        chunks, rest = chunks_along(piece.triangles, row, single.triangles, grid)
        first = chunks[0]
        if not len(first) or not all(
            len(chunk) and soups_match(first, chunk, pose, grid.cell_size / 2, MAX_CHUNK_DIFFERENCE)
            for chunk, pose in zip(chunks, piece.poses, strict=True)
        ):
            continue
        strain = max(strain, *(abs(chunk.area / first.area - 1) for chunk in chunks))
        gained, changed[other] = join_soups(gained, first), SurfacePiece(rest, single.poses)
    changed[index] = SurfacePiece(gained, piece.poses, strain)
    return changed


def _parts(pieces: list[SurfacePiece], grid: SurfaceGrid) -> list[SurfacePiece]:
    """Split pieces into connected ones that are large enough for parts.

    Smaller ones stay with the largest. Splinters between copies that belong to no copy are left out: they would make
    the remaining piece a neighbour of all copies.
    """
    copies = [
        transform_points(pose, piece.triangles.corners.reshape(-1, 3))
        for piece in pieces
        if len(piece.poses) > 1
        for pose in piece.poses
    ]
    copy_cells = _cells(np.concatenate(copies).reshape(-1, 3, 3), grid) if copies else np.empty((0, 3))
    parts: list[SurfacePiece] = []
    for piece in pieces:
        if not len(piece.triangles):
            continue
        soups = sorted(connected_soups(piece.triangles, grid.origin, grid.cell_size), key=lambda soup: -soup.area)
        large = [soup for soup in soups if soup.area > MIN_PART_SHARE * grid.area.sum()]
        if not large and len(piece.poses) > 1:
            large = soups[:1]
        splinters = soups[len(large) :]
        if len(piece.poses) == 1 and len(copy_cells):
            splinters = [soup for soup in splinters if not _touch(_cells(soup.corners, grid), copy_cells)]
        if not large:
            large, splinters = splinters[:1], splinters[1:]
        for splinter in splinters:
            large[0] = join_soups(large[0], splinter)
        parts += [SurfacePiece(soup, piece.poses, piece.strain) for soup in large]
    return parts


def _cells(corners: FloatArray, grid: SurfaceGrid) -> np.ndarray:
    """Return the cells of triangles (t, 3, 3), int64 (n, 3)."""
    return np.unique(fragments(corners, grid.origin, grid.cell_size)[0], axis=0)


def _touch(cells: np.ndarray, others: np.ndarray) -> bool:
    """Return whether one of some cells is one of the others or a neighbour of one."""
    from scipy.spatial import KDTree

    return bool((KDTree(others).query(cells, distance_upper_bound=NEIGHBOUR_CELLS)[0] < NEIGHBOUR_CELLS).any())
