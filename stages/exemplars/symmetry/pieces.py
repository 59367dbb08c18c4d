"""A surface cut into repeated pieces and what is left between them: parts for a mesh that has none."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stages.exemplars.symmetry.carve import Soup, carve, connected_soups, joined
from stages.exemplars.symmetry.repetition import PART, Repetition, repetitions
from stages.exemplars.symmetry.surface import SurfaceGrid, surface_grid
from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.pose import invert

__all__ = ["RADIUS", "Piece", "repeated_pieces"]

RADIUS = 0.016
"""Radius of similarity, as a share of the longest side of the model's box (symmetry §5)."""
TRIED = 10
"""So many repetitions are tried, those that save most first."""
BETTER = 0.98
"""Cuts must lower the cost at least by this factor."""
DUST = 1e-3
"""Share of their surface by which pieces that are equal may differ: slivers where borders of cells meet old seams."""
INSIDE = 0.8
"""Points that are compared lie so far from the middle of a triangle to its corners."""
SPLINTER = 5e-4
"""A piece that touches no other is a part if it is more than this share of the whole surface."""
CRUMB = 1e-7
"""What is smaller than this share of the surface is rounding."""


@dataclass(frozen=True)
class Piece:
    """A piece of the surface and everywhere it stands.

    triangles: in the world, where it stands at the identity; poses: rigid (4, 4), the identity first.
    """

    triangles: Soup
    poses: tuple[FloatArray, ...]


def repeated_pieces(vertices: FloatArray, faces: IntArray) -> list[Piece]:
    """The pieces of a mesh, vertices (v, 3) and faces (f, 3): cut between copies of what repeats, those that are equal
    once with all their poses. One piece alone where nothing repeats.

    Repetitions are taken one after another, that which saves most surface first, as long as the surface of the pieces
    that differ gets smaller by more than `PART` a piece; two that cross cut the pieces of a 2-grid. Triangles without
    area are left out.
    """
    corners = vertices[faces]
    grid = surface_grid(corners, RADIUS)
    whole = Soup(grid.corners, grid.faces)
    pieces, cost = [Piece(whole, (np.eye(4),))], 1.0 + PART
    for each in repetitions(grid)[:TRIED]:
        cut = [part for piece in pieces for part in _cut(piece, grid, each)]
        price = sum(piece.triangles.area for piece in cut) / whole.area + PART * sum(len(piece.poses) for piece in cut)
        if price < BETTER * cost:
            pieces, cost = cut, price
    if len(pieces) == 1:
        return pieces
    return [part for piece in pieces for part in _apart(piece, grid) if part.triangles.area > CRUMB * whole.area]


def _cut(piece: Piece, grid: SurfaceGrid, repetition: Repetition) -> list[Piece]:
    """A piece cut along the copies of a repetition; copies with one shape are one piece."""
    rest = piece.triangles
    cut: list[tuple[Piece, FloatArray]] = []
    for pose in repetition.poses:
        inside, rest = carve(rest, grid, repetition.band, pose)
        if repetition.ahead is not None:
            beyond, inside = carve(inside, grid, repetition.band, pose @ repetition.ahead)
            rest = joined(rest, beyond)
        if inside.area <= CRUMB * grid.area.sum():
            continue
        for place, (known, first) in enumerate(cut):
            way = pose @ invert(first)
            if _equal(known.triangles, inside, way, grid.tolerance):
                cut[place] = Piece(known.triangles, (*known.poses, *(pose @ way for pose in piece.poses))), first
                break
        else:
            cut.append((Piece(inside, piece.poses), pose))
    found = [each for each, _ in cut]
    return [*found, Piece(rest, piece.poses)] if len(rest) else found


def _equal(one: Soup, other: Soup, pose: FloatArray, tolerance: float) -> bool:
    """Whether `pose` moves one surface onto another, by points of all triangles but the smallest, which are dust."""
    from stages.shape.geometry.triangles import build_tree, points_on_surface

    if abs(one.area - other.area) > DUST * one.area:
        return False
    for source, target, way in ((one, other, pose), (other, one, invert(pose))):
        order = np.argsort(source.areas, kind="stable")
        large = source.corners[order[np.cumsum(source.areas[order]) > DUST * source.area]]
        middles = large.mean(axis=1, keepdims=True)
        probes = np.concatenate([middles, middles + INSIDE * (large - middles)], axis=1).reshape(-1, 3)
        tree = build_tree(target.corners.reshape(-1, 3), np.arange(3 * len(target)).reshape(-1, 3).astype(np.int32))
        if not points_on_surface(*tree, probes @ way[:3, :3].T + way[:3, 3], 2 * tolerance):
            return False
    return True


def _apart(piece: Piece, grid: SurfaceGrid) -> list[Piece]:
    """A piece as the pieces that do not touch each other; those too small to be parts stay with the largest."""
    found = sorted(connected_soups(piece.triangles, grid), key=lambda each: -each.area)
    parts = [each for each in found if each.area > SPLINTER * grid.area.sum()] or found[:1]
    for crumb in found[len(parts) :]:
        parts[0] = joined(parts[0], crumb)
    return [Piece(each, piece.poses) for each in parts]
