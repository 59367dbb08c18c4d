"""A surface cut by families of parallel planes into pieces, of which those that are equal are one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from stages.shape.arrays import FloatArray, IntArray
from stages.symmetry.matching.equality import soups_match
from stages.symmetry.pieces import RADIUS, SPLINTER, SurfacePiece
from stages.symmetry.rows import cut_by_plane
from stages.symmetry.sections.parallel_cuts import NEAR, ParallelCuts, find_parallel_cuts
from stages.symmetry.surface.grid import CELLS_PER_RADIUS, has_area
from stages.symmetry.surface.soup import Soup, connected_soups, join_soups

MOST = 500
"""Families are cut with as long as there are no more slabs than this."""
SAME = 0.06
"""Share of their surface by which pieces that are equal may differ, where something passes that hangs as it likes."""


def slab_pieces(vertices: FloatArray, faces: IntArray) -> list[SurfacePiece]:
    """The pieces of a mesh, vertices (v, 3) and faces (f, 3), cut at its `find_parallel_cuts`; equal ones once,
    with all their poses, which are shifts. One piece alone where no sections are alike.

    A slab is as many pieces as do not touch each other. Triangles without area are left out.
    """
    corners = vertices[faces]
    real = np.flatnonzero(has_area(corners)).astype(np.int32)
    whole = Soup(corners[real], real)
    families: list[ParallelCuts] = []
    slabs: list[tuple[tuple[int, ...], Soup]] = [((), whole)]
    for family in find_parallel_cuts(whole.corners):
        cut = [((*place, layer), part) for place, soup in slabs for layer, part in _layers(soup, family)]
        if len(cut) <= MOST:
            families.append(family)
            slabs = cut
    extent = float(np.ptp(vertices.reshape(-1, 3), axis=0).max())
    pieces: list[SurfacePiece] = []
    keys: list[FloatArray] = []
    corner_of: list[FloatArray] = []
    for place, slab in slabs:
        low, wide = _corner(families, place)
        for soup in _parts(slab, whole, extent):
            box = np.r_[soup.corners.min(axis=(0, 1)) - low, soup.corners.max(axis=(0, 1)) - low, wide]
            for number, piece in enumerate(pieces):
                pose = np.eye(4)
                pose[:3, 3] = low - corner_of[number]
                if np.abs(keys[number] - box).max() < 4 * NEAR * extent and soups_match(
                    piece.triangles, soup, pose, NEAR / 2 * extent, SAME
                ):
                    pieces[number] = SurfacePiece(piece.triangles, (*piece.poses, pose))
                    break
            else:
                pieces.append(SurfacePiece(soup, (np.eye(4),)))
                keys.append(box)
                corner_of.append(low)
    return pieces


def _layers(soup: Soup, family: ParallelCuts) -> Iterator[tuple[int, Soup]]:
    """What of a soup lies in each slab between two planes of a family, with the slab's number."""
    for layer, offset in enumerate(family.offsets.tolist()):
        below, soup = cut_by_plane(soup, family.way, offset)
        if len(below):
            yield layer, below
    if len(soup):
        yield len(family.offsets), soup


def _corner(families: Sequence[ParallelCuts], place: Sequence[int]) -> tuple[FloatArray, FloatArray]:
    """Where a slab begins, float64 (3,), and how wide it is along each family, with the number of those slabs that have
    no beginning or no end, float64 (2 n,): such are equal to no other."""
    low, wide = np.zeros(3), []
    for family, layer in zip(families, place, strict=True):
        ends = 0 < layer < len(family.offsets)
        if ends:
            low += family.offsets[layer - 1] * family.way
        wide += [
            float(family.offsets[layer] - family.offsets[layer - 1]) if ends else 0.0,
            0.0 if ends else layer + 1.0,
        ]
    return low, np.array(wide)


def _parts(slab: Soup, whole: Soup, extent: float) -> list[Soup]:
    """The pieces of a slab that do not touch; those too small to be parts go with the largest."""
    size = 2 * RADIUS / CELLS_PER_RADIUS * extent
    soups = sorted(connected_soups(slab, slab.corners.min(axis=(0, 1)) - size, size), key=lambda each: -each.area)
    parts = [each for each in soups if each.area > SPLINTER * whole.area] or soups[:1]
    for crumb in soups[len(parts) :]:
        parts[0] = join_soups(parts[0], crumb)
    return parts
