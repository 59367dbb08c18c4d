"""Random shapes of a grammar, and its grids with other numbers of cells (symmetry §4.2)."""

from __future__ import annotations

import numpy as np

from stages.grammars.collisions import Collisions
from stages.grammars.derivation import START, Derivation
from stages.grammars.derivation_text import PlacedTerminal, ResizedGrid
from stages.grammars.grammar import ShapeGrammar
from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose import invert

TRIES = 10
"""So many random rules are tried at a site before it gets what the exemplar has (symmetry §4.2)."""


class DerivationCollides(Exception):
    """What the exemplar has at a site runs into what stands there already."""


def random_derivation(grammar: ShapeGrammar, collisions: Collisions, most: int, rng: np.random.Generator) -> Derivation:
    """A shape by random productions: at each site a rule whose terminal runs into nothing, or after ten that do, and
    after `most` productions, what the exemplar has. Raises Collided where that runs into something."""
    return _Drawing(grammar, collisions, most, rng).whole()


def random_resized_grid(grammar: ShapeGrammar, most: int, rng: np.random.Generator) -> ResizedGrid:
    """A grid with 0 to `most` cells along each row."""
    grid = int(rng.integers(len(grammar.grids)))
    return ResizedGrid(grid, tuple(int(each) for each in rng.integers(0, most + 1, len(grammar.grids[grid].counts))))


class _Drawing:
    """A shape that grows."""

    def __init__(self, grammar: ShapeGrammar, collisions: Collisions, most: int, rng: np.random.Generator) -> None:
        self._grammar, self._collisions, self._most, self._rng = grammar, collisions, most, rng
        self._pieces: list[PlacedTerminal] = []
        self._seams: list[tuple[int, FloatArray]] = []

    def whole(self) -> Derivation:
        starts = self._grammar.productions_of_site[START]
        number = starts[int(self._rng.integers(len(starts)))]
        self._put(number, np.eye(4))
        return self._filled(number, np.eye(4))

    def _filled(self, number: int, motion: FloatArray) -> Derivation:
        """The production with something at all its places."""
        parts = [
            self._at_site(place.site, motion @ place.frame, place.original)
            for place in self._grammar.productions[number].non_terminals
        ]
        return Derivation(number, tuple(parts))

    def _at_site(self, site: int, frame: FloatArray, original: Derivation) -> Derivation:
        known = self._grammar.productions_of_site[site]
        for _ in range(TRIES if len(self._pieces) < self._most else 0):
            number = known[int(self._rng.integers(len(known)))]
            motion = frame @ invert(self._grammar.productions[number].frame)
            if self._put(number, motion):
                return self._filled(number, motion)
        self._original(original, frame)
        return original

    def _original(self, made: Derivation, frame: FloatArray) -> None:
        """Put what the exemplar has at a site."""
        motion = frame @ invert(self._grammar.productions[made.production].frame)
        if not self._put(made.production, motion):
            raise DerivationCollides
        for place, part in zip(self._grammar.productions[made.production].non_terminals, made.parts, strict=True):
            self._original(part, motion @ place.frame)

    def _put(self, number: int, motion: FloatArray) -> bool:
        """Whether the terminal of a rule runs into nothing; then it stands there."""
        rule = self._grammar.productions[number]
        piece = PlacedTerminal(rule.terminal, self._grammar.standing(rule.terminal, motion))
        seams = [(place.site, motion @ place.frame) for place in rule.non_terminals]
        if self._collisions.collides(piece, self._pieces, [*self._seams, *seams]):
            return False
        self._pieces.append(piece)
        self._seams += seams
        return True
