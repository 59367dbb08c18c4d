"""Replacement, one a call: the operations between two shapes, listed once and carried out one after the other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.kit import Kit
from stages.variations.kernels.answers import ContactAnswers
from stages.variations.kernels.layout import TRY, UPRIGHT, KitTables, Outcome, Workspace
from stages.variations.search.parents import Parent
from stages.variations.search.steering import Choice
from stages.variations.substitution.pieces import Exchanged
from stages.variations.substitution.substitute import Docked, find_motion, put_together
from stages.variations.substructures.embedding import Side, embed, pieces
from stages.variations.substructures.operations import Operations, find_operations
from stages.variations.substructures.sites import docking_graph

__all__ = ["Replacer"]

DRAWS = 48
"""Operations between two shapes that are carried out before it is another pair's turn, if listing them took no longer:
else as many as take that long."""
EMBEDDING_WORK = 12.0
"""What embedding costs beside a try of the exchange that finds no match."""
DARTS_A_TRY = 4000.0
"""Darts, and pairs of them, that are looked at in the time of one such try."""


@dataclass(frozen=True)
class Pair:
    """Two shapes, as they were chosen, what can be replaced between them, and what of it is left: numbers of
    operations, the second half of them the other way round."""

    choice: Choice
    sides: tuple[Side, Side]
    operations: Operations
    left: Iterator[int]

    @property
    def giver(self) -> Parent:
        return self.choice.a

    @property
    def base(self) -> Parent:
        return self.choice.b


class Replacer:
    """Replaces pieces within limits of size.

    dummies: dummy edges that a symmetry may use at most; by_docking: whether edges match by their dockings, which keeps
    rigid what is laid upon each other, or by the types at their ends alone.
    """

    def __init__(
        self, answers: ContactAnswers, tables: KitTables, smallest: int, largest: int, dummies: int, by_docking: bool
    ) -> None:
        self.answers, self.tables = answers, tables
        self.smallest, self.largest = smallest, largest
        self.dummies = dummies
        kit = answers.kit
        self._by_meaning = len(kit.labels) < len(kit.types)
        self._by_docking = by_docking and not self._by_meaning
        self._pair: Pair | None = None
        self._docked: Docked = []

    @property
    def choice(self) -> Choice:
        """What was chosen when the pair of the last try was, of which `a` was the giver and `b` the base."""
        assert self._pair is not None, "nothing was tried yet"
        return self._pair.choice

    def replace(self, rng: np.random.Generator, choice: Choice, ws: Workspace) -> tuple[int, float]:
        """Carry out one more operation of the pair in hand, or one between the two shapes that are chosen where nothing
        is left of it, in the workspace: the outcome and the work. After OK the contacts between the two are to be found
        by `connect`."""
        work = 1.0
        number = None if self._pair is None else next(self._pair.left, None)
        if self._pair is None or number is None:
            self._pair, cost = self._opened(rng, choice)
            work += cost
            number = next(self._pair.left, None)
            if number is None:
                return Outcome.NO_MATCH, work
        pair = self._pair
        count = len(pair.operations)
        boundary = pair.operations.boundary(number % count)[:, :: 1 if number < count else -1]
        base_side, giver_side = pair.sides
        taken, piece = pieces(base_side, giver_side, boundary)
        parts = int(piece.sum() + (~taken).sum())
        if not self.smallest <= parts <= self.largest:
            return Outcome.TOO_SMALL if parts < self.smallest else Outcome.TOO_LARGE, work
        if not piece.any() or taken.all():
            return Outcome.NOTHING_ATTACHED, work
        work += EMBEDDING_WORK
        if self._by_meaning:
            found = self._by_meanings(rng, pair, Exchanged(taken, piece))
        else:
            found = self._rigidly(rng, pair, boundary, taken, piece)
        if found is None:
            return Outcome.NO_MATCH, work
        motion, moved, self._docked = found
        put_together(self.tables, pair.giver, moved, Exchanged(taken, piece), motion, self._docked, ws)
        return Outcome.OK, work

    def _rigidly(
        self, rng: np.random.Generator, pair: Pair, boundary: np.ndarray, taken: np.ndarray, piece: np.ndarray
    ) -> tuple[FloatArray, Parent, Docked] | None:
        """The motion of the piece, the base as it makes room, and what docks to what; None where nothing does."""
        base, giver = pair.sides
        docked = _docked(base, giver, boundary, piece)
        embedding = embed(rng, self.answers.kit, self.tables.up, base, giver, boundary, taken) if docked else None
        if embedding is None:
            return None
        return embedding.motion, replace(pair.base, assembly=replace(base.assembly, poses=embedding.poses)), docked

    def _by_meanings(
        self, rng: np.random.Generator, pair: Pair, exchanged: Exchanged
    ) -> tuple[FloatArray, Parent, Docked] | None:
        """The same where parts of one label are other meshes: a docking of one of them, fitted to all."""
        base, giver, kit, up = pair.base.assembly, pair.giver.assembly, self.answers.kit, self.tables.up
        found = find_motion(rng, kit.label_of, self.answers.dockings, giver, base, exchanged)
        if found is None or (up >= 0 and found[0][up, up] < UPRIGHT):
            return None
        return found[0], pair.base, found[1]

    def is_joined(self, ws: Workspace) -> bool:
        """Whether, once contacts are found, every boundary part touches its new neighbour (§4.2)."""
        return all(ws.stamp[ws.from_a[inner], ws.from_b[hold]] == ws.counts[TRY] for inner, hold, _ in self._docked)

    def _opened(self, rng: np.random.Generator, choice: Choice) -> tuple[Pair, float]:
        """All operations between two shapes, in random order; and what that cost."""
        kit = self.answers.kit
        sides = _side(kit, choice.b), _side(kit, choice.a)
        first, second = sides[0].graph, (sides[0] if choice.a is choice.b else sides[1]).graph
        operations = find_operations(first, second, self.dummies, self._by_docking)
        ways = len(operations) * (2 if first is second else 1)
        work = operations.work / DARTS_A_TRY
        order = rng.permutation(ways)[: max(DRAWS, round(work / EMBEDDING_WORK))].tolist()
        return Pair(choice, sides, operations, iter(order)), work


def _side(kit: Kit, parent: Parent) -> Side:
    return Side(parent.assembly, docking_graph(kit, parent.assembly, parent.labels))


def _docked(base: Side, giver: Side, boundary: np.ndarray, piece: np.ndarray) -> Docked:
    """The parts of the piece at its boundary, each with the part of the base that it docks to, and its pose there."""
    docked: Docked = []
    for dart, image in boundary[(boundary >= 0).all(axis=1)].tolist():
        hold, inner = int(base.graph.tails[dart]), int(giver.graph.tails[giver.graph.twins[image]])
        if piece[inner]:
            docked.append((inner, hold, giver.assembly.poses[inner]))
    return docked
