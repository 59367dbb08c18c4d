"""Shapes of a grammar that differ visibly from its exemplar and from each other (symmetry §4.2)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from pipeline.randomness import decision_rng
from stages.grammars.collisions import Collisions
from stages.grammars.derivation import START_SITE, Derivation, ResizedGrid
from stages.grammars.derivation_text import format_derivation
from stages.grammars.derived_shape import PlacedTerminal, placed_terminals, surface_digest
from stages.grammars.grammar import ShapeGrammar
from stages.grammars.settings import GrammarConfig
from stages.grammars.voxel_signature import KnownShapes, VoxelSignature, difference
from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose import invert

RANDOM_RULES, RESIZED_GRID = "random rules", "resized grid"
METHODS = (RANDOM_RULES, RESIZED_GRID)
"""How shapes are made from a grammar; these words also name random streams."""
CANDIDATES_PER_SHAPE = 3
"""Draws from which the one that differs most is taken."""
CLEAR_DIFFERENCE = 0.2
"""A draw that differs more is taken at once: of two that clearly differ the larger one would differ more."""
MAX_FAILURES = 20
"""The search ends after this number of candidate sets without a new shape."""

MAX_TRIES_PER_SITE = 10
"""Random productions that are tried at a site before it gets the exemplar's (symmetry §4.2)."""


class DerivationCollides(Exception):
    """What the exemplar has at a site collides with what is there already."""


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


@dataclass(frozen=True)
class SampledShape:
    """A shape of a grammar: its method, the text of its derivation, and a digest of its surface."""

    method: str
    text: str
    digest: str


class DistinctShapes:
    """Samples shapes of a grammar until there are enough, or no more.

    A draw is rejected if it differs from the exemplar or an earlier shape by less than `config.min_difference`. Many
    productions restore nearly what was there. Of draws that differ little the one that differs most is taken.
    """

    def __init__(
        self,
        grammar: ShapeGrammar,
        config: GrammarConfig,
        rng: Callable[..., np.random.Generator],
        reject: Callable[[str], None],
    ) -> None:
        """Sample with a generator for each decision, `rng(*decision)`; call `reject(reason)` for rejected draws."""
        self._grammar, self._config, self._rng, self._reject = grammar, config, rng, reject
        self._collisions = Collisions(grammar)
        self._known = KnownShapes(grammar, self._collisions.samples)
        self._digests: set[str] = set()

    def shapes(self, method: str, limit: int) -> Iterator[SampledShape]:
        """Yield at most `limit` shapes by one of METHODS."""
        grammar = self._grammar
        if not (grammar.grids if method == RESIZED_GRID else len(grammar.productions) > 1):
            return
        count = failures = turn = 0
        while count < limit and failures < MAX_FAILURES:
            best = self._best(method, turn * CANDIDATES_PER_SHAPE)
            turn += 1
            if best is None:
                failures += 1
                continue
            count, failures = count + 1, 0
            _, shape, signature = best
            self._known.add(signature)
            self._digests.add(shape.digest)
            yield shape

    def _best(self, method: str, first: int) -> tuple[float, SampledShape, VoxelSignature] | None:
        """Return the best of the draws from number `first` on; None if all are rejected."""
        best = None
        for number in range(first, first + CANDIDATES_PER_SHAPE):
            candidate = self._candidate(method, number)
            if candidate is not None and (best is None or candidate[0] > best[0]):
                best = candidate
                if best[0] >= CLEAR_DIFFERENCE:
                    break
        return best

    def _candidate(self, method: str, number: int) -> tuple[float, SampledShape, VoxelSignature] | None:
        """Return a draw with its smallest difference to a known shape; None if it is rejected."""
        derivation = self._derivation(method, self._rng(method, number))
        if derivation is None:
            self._reject("collides with itself")
            return None
        terminals = placed_terminals(self._grammar, derivation)
        digest = surface_digest(self._grammar, terminals)
        if digest in self._digests:
            self._reject("like an earlier shape")
            return None
        signature = self._known.signature(terminals)
        differs = difference(signature, self._known.exemplar)
        if differs < self._config.min_difference:
            self._reject("like the exemplar")
            return None
        differs = min(differs, self._known.min_difference(signature))
        if differs < self._config.min_difference:
            self._reject("like an earlier shape")
            return None
        return differs, SampledShape(method, format_derivation(self._grammar, derivation), digest), signature

    def _derivation(self, method: str, rng: np.random.Generator) -> Derivation | ResizedGrid | None:
        """Draw a derivation; None where it collides with itself."""
        if method == RESIZED_GRID:
            resized = random_resized_grid(self._grammar, self._config.max_cells, rng)
            return None if self._collisions.grid_collides(resized) else resized
        max_pieces = int(rng.integers(1, self._config.max_pieces + 1))
        try:
            return random_derivation(self._grammar, self._collisions, max_pieces, rng)
        except DerivationCollides:
            return None


def preview_shapes(grammar: ShapeGrammar, config: GrammarConfig, limit: int) -> dict[str, list[str]]:
    """Return at most `limit` shapes by each of METHODS as texts: a preview of a dataset."""
    sampler = DistinctShapes(grammar, config, partial(decision_rng, 0, "inspect"), lambda _: None)
    return {method: [shape.text for shape in sampler.shapes(method, limit)] for method in METHODS}


def requested_counts(config: GrammarConfig) -> dict[str, int]:
    """Return how many shapes are requested by each of METHODS."""
    return {RANDOM_RULES: config.random_shapes, RESIZED_GRID: config.resized_grids}


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
