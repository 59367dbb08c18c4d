"""Terminals of a grammar: the triangles of a docked piece that are in none of some other pieces (symmetry §3.4.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stages.grammars.derivation import START_SITE
from stages.grammars.extraction.docked_pieces import DockedPiece
from stages.grammars.extraction.seams import Seam, cut_out
from stages.shape.arrays import BoolArray, ByteArray, FloatArray, IntArray
from stages.symmetry.matching.cell_lookup import PackedSubset
from stages.symmetry.surface.grid import SurfaceGrid
from stages.symmetry.surface.soup import Soup, join_soups

ALL_OUT, ALL_IN, CUT_BY_SEAM = 0, 1, 2
"""Where a triangle lies: outside a docked piece, in it, or on both sides of its seam."""


@dataclass(frozen=True)
class Terminal:
    """Triangles of a surface, and pieces of triangles that seams have cut.

    Terminals share what they have in common, because many have much in common.

    whole: the surface's triangles that are whole
    cut: pieces that no other terminal has
    pieces: int32, indices among all pieces that one seam cuts
    area: of all together
    """

    whole: PackedSubset
    cut: Soup
    pieces: IntArray
    area: float

    def __len__(self) -> int:
        return len(self.whole) + len(self.cut) + len(self.pieces)


def unshared_terminal(soup: Soup) -> Terminal:
    """Return a terminal of triangles that no other terminal has."""
    nothing = np.empty(0, dtype=np.int32)
    return Terminal(PackedSubset.of(nothing.astype(bool)), soup, nothing, soup.area)


@dataclass(frozen=True)
class _Side:
    """Where the triangles of a surface lie relative to a docked piece.

    of: uint8 (f,), ALL_OUT, ALL_IN or CUT_BY_SEAM
    within, beyond: the pieces of cut triangles inside and outside
    first: index of the first of these pieces among those of all docked pieces
    """

    of: ByteArray
    within: Soup
    beyond: Soup
    first: int

    def pieces(self, within: bool, chosen: BoolArray) -> tuple[IntArray, FloatArray]:
        """Return indices and areas of the pieces on one side of chosen triangles, bool (f,)."""
        soup, first = (self.within, self.first) if within else (self.beyond, self.first + len(self.within))
        indices = np.flatnonzero(chosen[soup.faces])
        return (first + indices).astype(np.int32), soup.areas[indices]


class TerminalCutter:
    """Cuts docked pieces out of the triangles of a surface, each once.

    Only triangles on two seams, of a piece and of a piece chosen in it, are cut for each such pair.
    """

    def __init__(self, grid: SurfaceGrid, docked_pieces: Sequence[DockedPiece], seams: dict[int, Seam]) -> None:
        self._grid, self._docked_pieces, self._seams = grid, docked_pieces, seams
        self._whole = Soup(grid.corners, grid.faces)
        self._known: dict[int, _Side] = {}
        self._count = 0

    def pieces(self) -> Soup:
        """Return the pieces of all triangles, each cut by one seam."""
        soups = [soup for side in self._known.values() for soup in (side.within, side.beyond)]
        return join_soups(*soups, Soup(np.empty((0, 3, 3)), np.empty(0, dtype=np.int32)))

    def between(self, node: int, chosen: Sequence[int]) -> Terminal:
        """Return the triangles of docked piece `node` that are in none of the chosen pieces."""
        first, others = self._side(node), [self._side(index) for index in chosen]
        left: BoolArray = first.of != ALL_OUT
        seams = (first.of == CUT_BY_SEAM).astype(np.uint8)
        for other in others:
            left &= other.of != ALL_IN
            seams += other.of == CUT_BY_SEAM
        once = left & (seams == 1)
        pieces = [first.pieces(True, once), *(other.pieces(False, once) for other in others)]
        faces = np.flatnonzero(left & (seams > 1)).astype(np.int32)
        cut = self._cut_out(Soup(self._whole.corners[faces], faces), node)[0]
        for index in chosen:
            cut = self._cut_out(cut, index)[1]
        whole = left & (seams == 0)
        area = float(self._whole.areas[whole].sum())
        area += float(np.concatenate([cut.areas, *(areas for _, areas in pieces)]).sum())
        return Terminal(PackedSubset.of(whole), cut, np.concatenate([indices for indices, _ in pieces]), area)

    def _side(self, index: int) -> _Side:
        if index not in self._known:
            count = len(self._whole)
            within, beyond = self._cut_out(Soup(self._whole.corners, np.arange(count, dtype=np.int32)), index)
            inside, outside = (np.bincount(soup.faces, minlength=count) for soup in (within, beyond))
            of = np.full(count, CUT_BY_SEAM, dtype=np.uint8)
            of[(inside == 1) & (outside == 0)] = ALL_IN
            of[(inside == 0) & (outside == 1)] = ALL_OUT
            within, beyond = (soup.select(of[soup.faces] == CUT_BY_SEAM) for soup in (within, beyond))
            self._known[index] = _Side(of, within, beyond, self._count)
            self._count += len(within) + len(beyond)
        return self._known[index]

    def _cut_out(self, soup: Soup, index: int) -> tuple[Soup, Soup]:
        """Split a soup into a docked piece and the rest."""
        piece = self._docked_pieces[index]
        if piece.site == START_SITE:
            return soup, soup.select(np.empty(0, dtype=np.int64))
        return cut_out(soup, self._grid, piece.cells, piece.frame, self._seams[piece.site])
