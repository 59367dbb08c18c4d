"""Terminals of a grammar: what of a docker's triangles is in none of some others (symmetry §3.4.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, reduce

import numpy as np

from stages.exemplars.symmetry.carve import Soup, joined
from stages.exemplars.symmetry.derivations import START
from stages.exemplars.symmetry.seams import Seam, cut_out
from stages.exemplars.symmetry.sites import Docker
from stages.exemplars.symmetry.surface import SurfaceGrid
from stages.shape.arrays import BoolArray, ByteArray, IntArray

__all__ = ["Cuts", "Terminal"]

OUTSIDE, INSIDE, CUT = 0, 1, 2
"""Where a triangle lies: outside a docker, in it, or on both sides of its seam."""


@dataclass(frozen=True)
class Terminal:
    """Triangles of a surface, and pieces of them that seams have cut: of many terminals that have much in common none
    holds what is whole.

    surface: all triangles; whole: places of those that are whole, int32; cut: the pieces.
    """

    surface: Soup
    whole: IntArray
    cut: Soup

    def __len__(self) -> int:
        return len(self.whole) + len(self.cut)

    @cached_property
    def area(self) -> float:
        """Area of all triangles."""
        return self.surface.select(self.whole).area + self.cut.area

    def soup(self) -> Soup:
        """All of its triangles."""
        return joined(self.surface.select(self.whole), self.cut)


@dataclass(frozen=True)
class _Side:
    """Where each triangle of a surface lies, uint8 (f,): OUTSIDE of a docker, INSIDE or CUT; and of those that are cut
    the pieces within it and beyond."""

    of: ByteArray
    within: Soup
    beyond: Soup


class Cuts:
    """Dockers cut out of the triangles of a surface. Each is cut once; only triangles on two seams, of a docker and of
    what is chosen in it, are cut anew for the two."""

    def __init__(self, grid: SurfaceGrid, every: Sequence[Docker], seams: dict[int, Seam]) -> None:
        self._grid, self._every, self._seams = grid, every, seams
        self._whole = Soup(grid.corners, grid.faces)
        self._known: dict[int, _Side] = {}

    def between(self, node: int, chosen: Sequence[int]) -> Terminal:
        """The triangles of docker `node` that are in none of those chosen."""
        first, others = self._side(node), [self._side(each) for each in chosen]
        left: BoolArray = first.of != OUTSIDE
        seams = (first.of == CUT).astype(np.uint8)
        for each in others:
            left &= each.of != INSIDE
            seams += each.of == CUT
        once = left & (seams == 1)
        pieces = [first.within.select(once[first.within.faces])]
        pieces += [each.beyond.select(once[each.beyond.faces]) for each in others]
        places = np.flatnonzero(left & (seams > 1)).astype(np.int32)
        soup = self._cut_out(Soup(self._grid.corners[places], places), node)[0]
        for number in chosen:
            soup = self._cut_out(soup, number)[1]
        cut = reduce(joined, pieces, soup)
        whole = np.flatnonzero(left & (seams == 0)).astype(np.int32)
        return Terminal(self._whole, whole, Soup(cut.corners, self._whole.faces[cut.faces]))

    def _side(self, place: int) -> _Side:
        if place not in self._known:
            count = len(self._whole)
            within, beyond = self._cut_out(Soup(self._whole.corners, np.arange(count, dtype=np.int32)), place)
            ins, outs = (np.bincount(each.faces, minlength=count) for each in (within, beyond))
            of = np.full(count, CUT, dtype=np.uint8)
            of[(ins == 1) & (outs == 0)] = INSIDE
            of[(ins == 0) & (outs == 1)] = OUTSIDE
            within, beyond = (each.select(of[each.faces] == CUT) for each in (within, beyond))
            self._known[place] = _Side(of, within, beyond)
        return self._known[place]

    def _cut_out(self, soup: Soup, place: int) -> tuple[Soup, Soup]:
        """What of a soup is in a docker, and what is not."""
        docker = self._every[place]
        if docker.site == START:
            return soup, soup.select(np.empty(0, dtype=np.int64))
        return cut_out(soup, self._grid, docker.cells, docker.frame, self._seams[docker.site])
