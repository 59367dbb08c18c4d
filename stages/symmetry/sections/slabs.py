"""A surface cut by families of parallel planes into slabs; equal pieces of slabs are one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from stages.shape.arrays import FloatArray, IntArray
from stages.symmetry.pieces import MIN_PART_SHARE, RADIUS_SHARE, SurfacePiece
from stages.symmetry.sections.parallel_cuts import SAME_POINT_SHARE, ParallelCuts, find_parallel_cuts
from stages.symmetry.surface.grid import CELLS_PER_RADIUS, has_area
from stages.symmetry.surface.soup import Soup, connected_soups, cut_by_plane, join_soups, soups_match

MAX_SLABS = 500
"""A family of planes that would make more slabs is not used."""
MAX_AREA_DIFFERENCE = 0.06
"""Share of their surface by which equal pieces may differ where something hangs freely through them."""


def slab_pieces(vertices: FloatArray, faces: IntArray) -> list[SurfacePiece]:
    """Cut a mesh, vertices (v, 3) and faces (f, 3), at its parallel cuts.

    Equal pieces are one, with all their poses, which are translations; a mesh without equal sections is one piece. The
    pieces of a slab do not touch each other. Triangles without area are left out.
    """
    corners = vertices[faces]
    real = np.flatnonzero(has_area(corners)).astype(np.int32)
    whole = Soup(corners[real], real)
    families: list[ParallelCuts] = []
    slabs: list[tuple[tuple[int, ...], Soup]] = [((), whole)]
    for family in find_parallel_cuts(whole.corners):
        cut = [((*layers, layer), part) for layers, soup in slabs for layer, part in _layers(soup, family)]
        if len(cut) <= MAX_SLABS:
            families.append(family)
            slabs = cut
    extent = float(np.ptp(vertices.reshape(-1, 3), axis=0).max())
    pieces: list[SurfacePiece] = []
    keys: list[FloatArray] = []
    corner_of: list[FloatArray] = []
    for layers, slab in slabs:
        low, widths = _corner_and_widths(families, layers)
        for soup in _parts(slab, whole, extent):
            box = np.r_[soup.corners.min(axis=(0, 1)) - low, soup.corners.max(axis=(0, 1)) - low, widths]
            for number, piece in enumerate(pieces):
                pose = np.eye(4)
                pose[:3, 3] = low - corner_of[number]
                if np.abs(keys[number] - box).max() < 4 * SAME_POINT_SHARE * extent and soups_match(
                    piece.triangles, soup, pose, SAME_POINT_SHARE / 2 * extent, MAX_AREA_DIFFERENCE
                ):
                    pieces[number] = SurfacePiece(piece.triangles, (*piece.poses, pose))
                    break
            else:
                pieces.append(SurfacePiece(soup, (np.eye(4),)))
                keys.append(box)
                corner_of.append(low)
    return pieces


def _layers(soup: Soup, family: ParallelCuts) -> Iterator[tuple[int, Soup]]:
    """Yield the number and the triangles of each slab between two planes of a family."""
    for layer, offset in enumerate(family.offsets.tolist()):
        below, soup = cut_by_plane(soup, family.normal, offset)
        if len(below):
            yield layer, below
    if len(soup):
        yield len(family.offsets), soup


def _corner_and_widths(families: Sequence[ParallelCuts], layers: Sequence[int]) -> tuple[FloatArray, FloatArray]:
    """Return where a slab begins, float64 (3,), and two numbers for each family, float64 (2 n,).

    The numbers are the width of the slab and 0. A slab without a beginning or an end equals no other: its numbers are 0
    and a unique number.
    """
    low, widths = np.zeros(3), []
    for family, layer in zip(families, layers, strict=True):
        bounded = 0 < layer < len(family.offsets)
        if bounded:
            low += family.offsets[layer - 1] * family.normal
        widths += [
            float(family.offsets[layer] - family.offsets[layer - 1]) if bounded else 0.0,
            0.0 if bounded else layer + 1.0,
        ]
    return low, np.array(widths)


def _parts(slab: Soup, whole: Soup, extent: float) -> list[Soup]:
    """Split a slab into pieces that do not touch; pieces too small for parts go with the largest."""
    size = 2 * RADIUS_SHARE / CELLS_PER_RADIUS * extent
    soups = sorted(connected_soups(slab, slab.corners.min(axis=(0, 1)) - size, size), key=lambda soup: -soup.area)
    parts = [soup for soup in soups if soup.area > MIN_PART_SHARE * whole.area] or soups[:1]
    for splinter in soups[len(parts) :]:
        parts[0] = join_soups(parts[0], splinter)
    return parts
