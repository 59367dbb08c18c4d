"""A surface cut into repeated pieces and what is left between them: parts for a mesh that has none."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.pose import invert, transform_points
from stages.symmetry.matching.equality import soups_match
from stages.symmetry.matching.repetitions import PART, Repetition, find_repetitions
from stages.symmetry.rows import chunks_along, find_row
from stages.symmetry.surface.clip import fragments
from stages.symmetry.surface.grid import SurfaceGrid, surface_grid
from stages.symmetry.surface.soup import Soup, carve, connected_soups, join_soups

RADIUS = 0.016
"""Radius of similarity, as a share of the longest side of the model's box (symmetry §5)."""
TRIED = 10
"""So many repetitions are tried, those that save most first."""
BETTER = 0.98
"""Cuts must lower the cost at least by this factor."""
SPLINTER = 5e-4
"""A piece that touches no other is a part if it is more than this share of the whole surface."""
ROUNDS = 3
"""So many times what is left in one piece is searched again: rows hide others that save less."""
LOOSE = 0.3
"""Share of their surface by which chunks of what runs along a row may differ; they lie less than a cell apart."""
BESIDE = 1.8
"""Cells whose middles are closer than this are neighbours."""
CRUMB = 1e-7
"""What is smaller than this share of the surface is rounding."""


@dataclass(frozen=True)
class SurfacePiece:
    """A piece of the surface and everywhere it stands.

    triangles: in the world, where it stands at the identity; poses: rigid (4, 4), the identity first; strained: by what
    share of its surface what runs along a row, and goes with this piece, was larger or smaller at another pose.
    """

    triangles: Soup
    poses: tuple[FloatArray, ...]
    strained: float = 0.0


def repeated_pieces(vertices: FloatArray, faces: IntArray) -> list[SurfacePiece]:
    """The pieces of a mesh, vertices (v, 3) and faces (f, 3): cut between copies of what repeats, those that are equal
    once with all their poses. One piece alone where nothing repeats.

    Repetitions are taken one after another, that which saves most surface first, as long as the surface of the pieces
    that differ gets smaller by more than `PART` a piece; two that cross cut the pieces of a 2-grid. Triangles without
    area are left out.
    """
    corners = vertices[faces]
    grid = surface_grid(corners, RADIUS)
    whole = Soup(grid.corners, grid.faces)
    pieces, cost = [SurfacePiece(whole, (np.eye(4),))], 1.0 + PART
    for turn in range(ROUNDS):
        left = max(
            (each for each in pieces if len(each.poses) == 1), key=lambda each: each.triangles.area, default=None
        )
        if left is None or not len(left.triangles):
            break
        before = cost
        others = [each for each in pieces if each is not left]
        pieces, cost = _searched(left, others, grid if turn == 0 else _grid_like(grid, left), whole.area, cost)
        if cost == before:
            break
    if len(pieces) == 1:
        return pieces
    for place in range(len(pieces)):
        pieces = _with_what_runs_along(pieces, place, grid)
    return [part for part in _parts(pieces, grid) if part.triangles.area > CRUMB * whole.area]


def _grid_like(grid: SurfaceGrid, piece: SurfacePiece) -> SurfaceGrid:
    """A grid of a piece alone, with cells as large as those of `grid`."""
    corners = piece.triangles.corners
    return surface_grid(corners, grid.radius / float(np.ptp(corners.reshape(-1, 3), axis=0).max()))


def _searched(
    left: SurfacePiece, others: list[SurfacePiece], grid: SurfaceGrid, whole: float, cost: float
) -> tuple[list[SurfacePiece], float]:
    """`left` cut by what it repeats, with the other pieces, and what they all cost."""
    pieces = [left]
    for each in find_repetitions(grid)[:TRIED]:
        cut = [part for piece in pieces for part in _cut(piece, grid, each)]
        every = [*others, *cut]
        price = sum(piece.triangles.area for piece in every) / whole + PART * sum(len(piece.poses) for piece in every)
        if price < BETTER * cost:
            pieces, cost = cut, price
    return [*others, *pieces], cost


def _cut(piece: SurfacePiece, grid: SurfaceGrid, repetition: Repetition) -> list[SurfacePiece]:
    """A piece cut along the copies of a repetition; copies with one shape are one piece."""
    rest = piece.triangles
    cut: list[tuple[SurfacePiece, FloatArray]] = []
    for pose in repetition.poses:
        inside, rest = carve(rest, grid, repetition.band, pose)
        if repetition.ahead is not None:
            beyond, inside = carve(inside, grid, repetition.band, pose @ repetition.ahead)
            rest = join_soups(rest, beyond)
        if inside.area <= CRUMB * grid.area.sum():
            continue
        for place, (known, first) in enumerate(cut):
            way = pose @ invert(first)
            if soups_match(known.triangles, inside, way, grid.tolerance):
                cut[place] = SurfacePiece(known.triangles, (*known.poses, *(pose @ way for pose in piece.poses))), first
                break
        else:
            cut.append((SurfacePiece(inside, piece.poses), pose))
    found = [each for each, _ in cut]
    return [*found, SurfacePiece(rest, piece.poses)] if len(rest) else found


def _with_what_runs_along(pieces: list[SurfacePiece], place: int, grid: SurfaceGrid) -> list[SurfacePiece]:
    """The pieces, where those at `place` make a row with what runs along it; all as they are where it has none, or not
    about the same at all copies.

    A cable beside a mast hangs as it likes: the chunk of the first copy stands for those that lie within a cell of it.
    """
    piece = pieces[place]
    row = find_row(piece.poses, grid.tolerance)
    if row is None:
        return pieces
    found = list(pieces)
    gained, strained = piece.triangles, piece.strained
    for other, single in enumerate(pieces):
        if other == place or len(single.poses) > 1:
            continue
        chunks, rest = chunks_along(piece.triangles, row, single.triangles, grid)
        first = chunks[0]
        if not len(first) or not all(
            len(chunk) and soups_match(first, chunk, pose, grid.cell_size / 2, LOOSE)
            for chunk, pose in zip(chunks, piece.poses, strict=True)
        ):
            continue
        strained = max(strained, *(abs(chunk.area / first.area - 1) for chunk in chunks))
        gained, found[other] = join_soups(gained, first), SurfacePiece(rest, single.poses)
    found[place] = SurfacePiece(gained, piece.poses, strained)
    return found


def _parts(pieces: list[SurfacePiece], grid: SurfaceGrid) -> list[SurfacePiece]:
    """Each piece as the pieces that do not touch each other, if they are large enough to be parts.

    What is smaller stays with the largest of them, but what lies between copies and is of no copy is left out: it would
    make a neighbour of all of them of what is left.
    """
    copies = [
        transform_points(pose, each.triangles.corners.reshape(-1, 3))
        for each in pieces
        if len(each.poses) > 1
        for pose in each.poses
    ]
    beside = _cells(np.concatenate(copies).reshape(-1, 3, 3), grid) if copies else np.empty((0, 3))
    found: list[SurfacePiece] = []
    for piece in pieces:
        if not len(piece.triangles):
            continue
        soups = sorted(connected_soups(piece.triangles, grid.origin, grid.cell_size), key=lambda each: -each.area)
        parts = [each for each in soups if each.area > SPLINTER * grid.area.sum()]
        if not parts and len(piece.poses) > 1:
            parts = soups[:1]
        crumbs = soups[len(parts) :]
        if len(piece.poses) == 1 and len(beside):
            crumbs = [each for each in crumbs if not _near(_cells(each.corners, grid), beside)]
        if not parts:
            parts, crumbs = crumbs[:1], crumbs[1:]
        for crumb in crumbs:
            parts[0] = join_soups(parts[0], crumb)
        found += [SurfacePiece(each, piece.poses, piece.strained) for each in parts]
    return found


def _cells(corners: FloatArray, grid: SurfaceGrid) -> np.ndarray:
    """The cells of triangles (t, 3, 3), int64 (n, 3)."""
    return np.unique(fragments(corners, grid.origin, grid.cell_size)[0], axis=0)


def _near(cells: np.ndarray, others: np.ndarray) -> bool:
    """Whether one of some cells is, or is beside, one of others."""
    from scipy.spatial import KDTree

    return bool((KDTree(others).query(cells, distance_upper_bound=BESIDE)[0] < BESIDE).any())
