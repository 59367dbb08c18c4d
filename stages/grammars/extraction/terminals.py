"""Terminals of a grammar: what of a docker's triangles is in none of some others (symmetry §3.4.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stages.grammars.derivation import START
from stages.grammars.extraction.docked_pieces import DockedPiece
from stages.grammars.extraction.seams import Seam, cut_out
from stages.shape.arrays import BoolArray, ByteArray, FloatArray, IntArray
from stages.symmetry.matching.cell_lookup import ChosenSet
from stages.symmetry.surface.grid import SurfaceGrid
from stages.symmetry.surface.soup import Soup, join_soups

OUTSIDE, INSIDE, CUT = 0, 1, 2
"""Where a triangle lies: outside a docker, in it, or on both sides of its seam."""


@dataclass(frozen=True)
class Terminal:
    """Triangles of a surface and pieces of them that seams have cut. Of many terminals that have much in common none
    holds what it shares with others.

    whole: of a surface's triangles those that are whole; cut: pieces that no other terminal has; pieces: places among
    all that one seam cuts, int32; area: of all together.
    """

    whole: ChosenSet
    cut: Soup
    pieces: IntArray
    area: float

    def __len__(self) -> int:
        return len(self.whole) + len(self.cut) + len(self.pieces)


def unshared_terminal(soup: Soup) -> Terminal:
    """Triangles that have nothing in common with others."""
    nothing = np.empty(0, dtype=np.int32)
    return Terminal(ChosenSet.of(nothing.astype(bool)), soup, nothing, soup.area)


@dataclass(frozen=True)
class _Side:
    """Where each triangle of a surface lies, uint8 (f,): OUTSIDE of a docker, INSIDE or CUT; and of those that are cut
    the pieces within it and beyond, which are `first` and following among the pieces of all dockers."""

    of: ByteArray
    within: Soup
    beyond: Soup
    first: int

    def pieces(self, within: bool, chosen: BoolArray) -> tuple[IntArray, FloatArray]:
        """The pieces on one side of chosen triangles, bool (f,): their places and areas."""
        soup, first = (self.within, self.first) if within else (self.beyond, self.first + len(self.within))
        places = np.flatnonzero(chosen[soup.faces])
        return (first + places).astype(np.int32), soup.areas[places]


class TerminalCutter:
    """Dockers cut out of the triangles of a surface. Each is cut once; only triangles on two seams, of a docker and of
    what is chosen in it, are cut anew for the two."""

    def __init__(self, grid: SurfaceGrid, every: Sequence[DockedPiece], seams: dict[int, Seam]) -> None:
        self._grid, self._every, self._seams = grid, every, seams
        self._whole = Soup(grid.corners, grid.faces)
        self._known: dict[int, _Side] = {}
        self._count = 0

    def pieces(self) -> Soup:
        """The pieces of all triangles that seams have cut, one at a time."""
        every = [soup for each in self._known.values() for soup in (each.within, each.beyond)]
        return join_soups(*every, Soup(np.empty((0, 3, 3)), np.empty(0, dtype=np.int32)))

    def between(self, node: int, chosen: Sequence[int]) -> Terminal:
        """The triangles of docker `node` that are in none of those chosen."""
        first, others = self._side(node), [self._side(each) for each in chosen]
        left: BoolArray = first.of != OUTSIDE
        seams = (first.of == CUT).astype(np.uint8)
        for each in others:
            left &= each.of != INSIDE
            seams += each.of == CUT
        once = left & (seams == 1)
        pieces = [first.pieces(True, once), *(each.pieces(False, once) for each in others)]
        places = np.flatnonzero(left & (seams > 1)).astype(np.int32)
        cut = self._cut_out(Soup(self._whole.corners[places], places), node)[0]
        for number in chosen:
            cut = self._cut_out(cut, number)[1]
        whole = left & (seams == 0)
        area = float(self._whole.areas[whole].sum())
        area += float(np.concatenate([cut.areas, *(areas for _, areas in pieces)]).sum())
        return Terminal(ChosenSet.of(whole), cut, np.concatenate([found for found, _ in pieces]), area)

    def _side(self, place: int) -> _Side:
        if place not in self._known:
            count = len(self._whole)
            within, beyond = self._cut_out(Soup(self._whole.corners, np.arange(count, dtype=np.int32)), place)
            ins, outs = (np.bincount(each.faces, minlength=count) for each in (within, beyond))
            of = np.full(count, CUT, dtype=np.uint8)
            of[(ins == 1) & (outs == 0)] = INSIDE
            of[(ins == 0) & (outs == 1)] = OUTSIDE
            within, beyond = (each.select(of[each.faces] == CUT) for each in (within, beyond))
            self._known[place] = _Side(of, within, beyond, self._count)
            self._count += len(within) + len(beyond)
        return self._known[place]

    def _cut_out(self, soup: Soup, place: int) -> tuple[Soup, Soup]:
        """What of a soup is in a docker, and what is not."""
        docker = self._every[place]
        if docker.site == START:
            return soup, soup.select(np.empty(0, dtype=np.int64))
        return cut_out(soup, self._grid, docker.cells, docker.frame, self._seams[docker.site])
