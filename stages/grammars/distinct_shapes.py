"""Shapes of a grammar that differ from its exemplar, and from each other, by something one sees (symmetry §4.2)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from pipeline.randomness import decision_rng
from stages.grammars.collisions import Collisions
from stages.grammars.derivation import Derivation
from stages.grammars.derivation_text import ResizedGrid, format_derivation, placed_terminals, surface_digest
from stages.grammars.grammar import ShapeGrammar
from stages.grammars.random_derivations import DerivationCollides, random_derivation, random_resized_grid
from stages.grammars.settings import GrammarConfig
from stages.grammars.voxel_signature import KnownShapes, VoxelSignature, difference

METHODS = ("random rules", "resized grid")
"""How shapes are made of a grammar."""
CANDIDATES = 3
"""Of at most so many draws the one is taken that differs most from what there is."""
PLAIN = 0.2
"""A draw of which so much differs is taken at once: of two that differ plainly the larger would differ more."""
IN_VAIN = 20
"""After so many times of these without a new shape there are no more."""


@dataclass(frozen=True)
class SampledShape:
    """A shape of a grammar: how it was made, its derivation's text, and a digest of its surface."""

    method: str
    text: str
    digest: str


class DistinctShapes:
    """Draws shapes of a grammar until there are as many as are asked for, or no more.

    rng: a generator for each decision, by its name; refuse: told why a draw is not taken. What differs from the
    exemplar or from one that was drawn by less than `config.min_difference` is refused,
    there; and of draws that differ by little the one that differs most is taken.
    """

    def __init__(
        self,
        grammar: ShapeGrammar,
        config: GrammarConfig,
        rng: Callable[..., np.random.Generator],
        refuse: Callable[[str], None],
    ) -> None:
        self._grammar, self._config, self._rng, self._refuse = grammar, config, rng, refuse
        self._collisions = Collisions(grammar)
        self._known = KnownShapes(grammar, self._collisions.samples)
        self._digests: set[str] = set()

    def shapes(self, method: str, most: int) -> Iterator[SampledShape]:
        """At most so many shapes by one of METHODS."""
        grammar = self._grammar
        if not (grammar.grids if method == "resized grid" else len(grammar.productions) > 1):
            return
        made = vain = turn = 0
        while made < most and vain < IN_VAIN:
            best = self._best(method, turn * CANDIDATES)
            turn += 1
            if best is None:
                vain += 1
                continue
            made, vain = made + 1, 0
            _, drawn, sight = best
            self._known.add(sight)
            self._digests.add(drawn.digest)
            yield drawn

    def _best(self, method: str, first: int) -> tuple[float, SampledShape, VoxelSignature] | None:
        """Of draws from the number `first` on the best one; None where all are refused."""
        best = None
        for number in range(first, first + CANDIDATES):
            found = self._candidate(method, number)
            if found is not None and (best is None or found[0] > best[0]):
                best = found
                if best[0] >= PLAIN:
                    break
        return best

    def _candidate(self, method: str, number: int) -> tuple[float, SampledShape, VoxelSignature] | None:
        """A draw, and how much it differs from all there is; None for one that is refused."""
        made = self._made(method, self._rng(method, number))
        if made is None:
            self._refuse("runs into itself")
            return None
        pieces = placed_terminals(self._grammar, made)
        digest = surface_digest(self._grammar, pieces)
        if digest in self._digests:
            self._refuse("like one drawn before")
            return None
        sight = self._known.sight(pieces)
        differs = difference(sight, self._known.exemplar)
        if differs < self._config.min_difference:
            self._refuse("like the exemplar")
            return None
        differs = min(differs, self._known.nearest(sight))
        if differs < self._config.min_difference:
            self._refuse("like one drawn before")
            return None
        return differs, SampledShape(method, format_derivation(self._grammar, made), digest), sight

    def _made(self, method: str, rng: np.random.Generator) -> Derivation | ResizedGrid | None:
        """A draw; None where it runs into itself."""
        if method == "resized grid":
            counts = random_resized_grid(self._grammar, self._config.max_cells, rng)
            return None if self._collisions.whole(counts) else counts
        try:
            return random_derivation(
                self._grammar, self._collisions, int(rng.integers(1, self._config.max_pieces + 1)), rng
            )
        except DerivationCollides:
            return None


def preview_shapes(grammar: ShapeGrammar, config: GrammarConfig, most: int) -> dict[str, list[str]]:
    """At most so many shapes by each of METHODS, as texts: a glimpse of what a dataset would have."""
    variety = DistinctShapes(grammar, config, partial(decision_rng, 0, "inspect"), lambda _: None)
    return {method: [each.text for each in variety.shapes(method, most)] for method in METHODS}


def requested_counts(config: GrammarConfig) -> dict[str, int]:
    """How many shapes are asked for, by METHODS."""
    return dict(zip(METHODS, (config.instances, config.resized), strict=True))


def shortfall_message(config: GrammarConfig, made: int) -> str:
    """What to say of a grammar that gives fewer shapes than are asked for, in one sentence."""
    asked = sum(requested_counts(config).values())
    return (
        f"{config.name}: {made:,} of {asked:,} shapes that are asked for; all else that its grammar gives runs into "
        f"itself, or looks like the exemplar or one of these (apart {config.min_difference:g}). Set "
        f"grammars.models[{config.name}].radius smaller, which finds more sites, or apart smaller, or take the model "
        "by its parts: exemplars.kits"
    )
