"""Random shapes of a grammar, and its grids with other numbers of cells (symmetry §4.2)."""

from __future__ import annotations

import numpy as np

from stages.grammars.collisions import Collisions
from stages.grammars.derivation import START_SITE, Derivation, ResizedGrid
from stages.grammars.derived_shape import PlacedTerminal
from stages.grammars.grammar import ShapeGrammar
from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose import invert

MAX_TRIES_PER_SITE = 10
"""Random productions that are tried at a site before it gets the exemplar's (symmetry §4.2)."""


class DerivationCollides(Exception):
    """What the exemplar has at a site collides with what is there already."""


def random_derivation(
    grammar: ShapeGrammar, collisions: Collisions, max_pieces: int, rng: np.random.Generator
) -> Derivation:
    """Return a shape by random productions.

    Each site gets a production whose terminal does not collide. After MAX_TRIES_PER_SITE that do, and after
    `max_pieces` productions, it gets what the exemplar has. Raises DerivationCollides where that collides too.
    """
    return _RandomShape(grammar, collisions, max_pieces, rng).whole()


def random_resized_grid(grammar: ShapeGrammar, max_cells: int, rng: np.random.Generator) -> ResizedGrid:
    """Return a grid with 0 to `max_cells` cells in each row."""
    grid = int(rng.integers(len(grammar.grids)))
    counts = rng.integers(0, max_cells + 1, len(grammar.grids[grid].counts))
    return ResizedGrid(grid, tuple(int(count) for count in counts))


class _RandomShape:
    """A shape that grows."""

    def __init__(
        self, grammar: ShapeGrammar, collisions: Collisions, max_pieces: int, rng: np.random.Generator
    ) -> None:
        self._grammar, self._collisions, self._max_pieces, self._rng = grammar, collisions, max_pieces, rng
        self._pieces: list[PlacedTerminal] = []
        self._seams: list[tuple[int, FloatArray]] = []

    def whole(self) -> Derivation:
        starts = self._grammar.productions_of_site[START_SITE]
        number = starts[int(self._rng.integers(len(starts)))]
        self._place(number, np.eye(4))
        return self._filled(number, np.eye(4))

    def _filled(self, number: int, transform: FloatArray) -> Derivation:
        """Derive all non-terminals of a production."""
        parts = [
            self._at_site(non_terminal.site, transform @ non_terminal.frame, non_terminal.original)
            for non_terminal in self._grammar.productions[number].non_terminals
        ]
        return Derivation(number, tuple(parts))

    def _at_site(self, site: int, frame: FloatArray, original: Derivation) -> Derivation:
        known = self._grammar.productions_of_site[site]
        for _ in range(MAX_TRIES_PER_SITE if len(self._pieces) < self._max_pieces else 0):
            number = known[int(self._rng.integers(len(known)))]
            transform = frame @ invert(self._grammar.productions[number].frame)
            if self._place(number, transform):
                return self._filled(number, transform)
        self._place_original(original, frame)
        return original

    def _place_original(self, derivation: Derivation, frame: FloatArray) -> None:
        """Place what the exemplar has at a site."""
        production = self._grammar.productions[derivation.production]
        transform = frame @ invert(production.frame)
        if not self._place(derivation.production, transform):
            raise DerivationCollides
        for non_terminal, part in zip(production.non_terminals, derivation.parts, strict=True):
            self._place_original(part, transform @ non_terminal.frame)

    def _place(self, number: int, transform: FloatArray) -> bool:
        """Place the terminal of a production unless it collides; return whether it is placed."""
        production = self._grammar.productions[number]
        piece = PlacedTerminal(production.terminal, self._grammar.mesh_pose(production.terminal, transform))
        seams = [(non_terminal.site, transform @ non_terminal.frame) for non_terminal in production.non_terminals]
        if self._collisions.collides(piece, self._pieces, [*self._seams, *seams]):
            return False
        self._pieces.append(piece)
        self._seams += seams
        return True
