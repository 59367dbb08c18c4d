"""Replacement, one a call: the operations between two shapes, listed once and carried out one after the other."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.geometry.pose import invert
from stages.shape.kit import Assembly, Kit
from stages.shape.stretch import split
from stages.variations.kernels.structs import TRY, UPRIGHT, KitTables, Outcome, Workspace
from stages.variations.kernels.tables import shape_tables
from stages.variations.kernels.variant_graph import set_edge
from stages.variations.requirements.resizing import rigid_types
from stages.variations.search.operator_selection import PlannedTry
from stages.variations.search.parents import Parent
from stages.variations.settings import SearchConfig
from stages.variations.substitution.pieces import Exchanged
from stages.variations.substitution.substitute import Docked, find_motion, put_together
from stages.variations.substructures.alignments import MOST_WORK, find_region_swaps
from stages.variations.substructures.consistency import make_consistent
from stages.variations.substructures.deformation import blend, is_oriented_alike
from stages.variations.substructures.docking_sites import contact_graph, docking_graph
from stages.variations.substructures.embedding import Side, embed, pieces
from stages.variations.substructures.operations import Operations, find_operations
from stages.variations.substructures.ordered_graph import OrderedGraph
from stages.variations.substructures.recursive_rules import cut_again, cut_farther, growth_of
from stages.variations.substructures.region_swaps import RegionSwaps
from stages.variations.substructures.replacement import replace_piece
from stages.variations.substructures.result_key import moved_key, result_key
from stages.variations.substructures.stretching import stretch_onto

FIRST_WORK, DEEPER = 1 << 19, 16
"""Parts that are laid upon others when two shapes are first drawn, at most; and how many times as many when they are
drawn again and nothing is left: motions under which most coincides come first."""
DRAWS = 48
"""Operations between two shapes that are carried out before it is another pair's turn, if listing them took no longer:
else as many as take that long."""
MOST_OPEN = 16
"""Pairs of shapes whose lists are kept, so that a pair that is drawn again goes on where it was left."""
EMBEDDING_WORK = 12.0
"""What embedding costs beside a try of the exchange that finds no match."""
ORDERED, BENT = 0.1, 0.75
"""The most of the work that is given to operations by the order of docking sites where motions are known too: they
find what moves the parts that stay apart, and take long to list; and where pieces may be bent or stretched, for only
these are."""
WITHIN = 0.25
"""How often a shape is laid upon itself whatever else was drawn: recursive rules are within one shape."""
BLENDED = 0.5
"""How often a piece is bent at once where parts of one label are other meshes, for there most can be docked as a whole
somehow."""

Found = tuple[FloatArray, FloatArray, Docked]
"""The motion of the piece (4, 4) or of each of its parts (k, 4, 4), the poses of the base, and what docks to what."""
DARTS_A_TRY = 4000.0
"""Darts, and pairs of them, that are looked at in the time of one such try."""


@dataclass(frozen=True)
class Pair:
    """Two shapes, as they were chosen, what can be replaced between them, and what of it is left: numbers of moves, or,
    once operations are listed, which is when no move is left, of these, of one shape the second half of them the other
    way round; `reach`: how many parts were laid upon others at most where moves were listed."""

    choice: PlannedTry
    sides: tuple[Side, Side]
    left: list[int]
    moves: RegionSwaps | None = None
    reach: int = FIRST_WORK // DEEPER
    operations: Operations | None = None

    @property
    def giver(self) -> Parent:
        return self.choice.a

    @property
    def base(self) -> Parent:
        return self.choice.b


class Replacer:
    """Replaces pieces within limits of size, as a config says. Matched by pose, shapes are laid upon each other by
    motions first, also where pieces may be stretched: parents never are, and what comes of a motion fits as it is. In
    what comes after, edges match by their dockings, which keeps rigid what is laid upon each other; else, and where
    types go by meaning or pieces may be stretched, by the types at their ends alone.

    After a try that is OK, `base` is what the piece was put into: the shape that was chosen, or what all times but the
    last of a recursive rule have made of it; `times` is how often the operation was carried out; `stretches`
    float64 (n, 3, 3) are those of the parts where the piece was stretched, else None. `lists` counts the
    lists of operations that were made, by whether each was whole or cut short. `known` are keys of shapes, by graph and
    dockings, that need not be put together again.
    """

    base: Parent
    times = 1
    stretches: FloatArray | None = None

    def __init__(
        self, answers: ContactOracle, tables: KitTables, smallest: int, largest: int, config: SearchConfig
    ) -> None:
        self.answers, self.tables = answers, tables
        self.min_parts, self.max_parts = smallest, largest
        self.dummy_edges, self.max_repeats = config.dummy_edges, config.max_repeats
        self.blends, self.most = config.deform, config.stretch.max_factor
        kit = answers.kit
        self._rigid = rigid_types(kit, config.stretch.rigid)
        self._by_meaning = kit.by_meaning
        self._moves = config.matching == "pose" and not self._by_meaning
        self._by_docking = self._moves and self.most == 1
        self._share = BENT if self.blends or self.most > 1 else ORDERED
        self.lists: Counter[str] = Counter()
        self.known: set[int] = set()
        self._open: dict[tuple[int, int], Pair] = {}
        self._turns = 0
        self._work = self._ordered = 0.0
        self._pair: Pair | None = None
        self._docked: Docked = []
        self._bent: np.ndarray | None = None
        self._cut: tuple[Side, Side, np.ndarray] | None = None

    @property
    def choice(self) -> PlannedTry:
        """What was chosen when the pair of the last try was, of which `a` was the giver and `b` the base."""
        assert self._pair is not None, "nothing was tried yet"
        return self._pair.choice

    def replace(self, rng: np.random.Generator, choice: PlannedTry, ws: Workspace) -> tuple[int, float]:
        """Carry out one more operation of the pair in hand, or one between the two shapes that are chosen where nothing
        is left of it, in the workspace: the outcome and the work. After OK the contacts between the two are to be found
        by `connect`."""
        outcome, work = self._turn(rng, choice, ws)
        self._work += work
        if self._pair is not None and self._pair.operations is not None:
            self._ordered += work
        return outcome, work

    def _turn(self, rng: np.random.Generator, choice: PlannedTry, ws: Workspace) -> tuple[int, float]:
        work = 1.0
        if self._pair is None or self._turns <= 0 or not self._pair.left:
            self._pair, cost = self._opened(rng, choice)
            work += cost
        pair = self._pair
        if not pair.left:  # nothing can be replaced, or all has been
            return Outcome.KNOWN if pair.operations or pair.moves else Outcome.NO_MATCH, work
        number = pair.left.pop()
        if pair.operations is None:
            outcome, cost = self._move(rng, pair, number, ws)
        else:
            outcome, cost = self._operate(rng, pair, pair.operations, number, ws)
        return outcome, work + cost

    def _operate(
        self, rng: np.random.Generator, pair: Pair, operations: Operations, number: int, ws: Workspace
    ) -> tuple[int, float]:
        """Carry out an operation along a boundary of docking sites, in the workspace: the outcome and the work."""
        work = 0.0
        count = len(operations)
        boundary = operations.boundary(number % count)[:, :: 1 if number < count else -1]
        self.base, side, self.times = pair.base, pair.sides[0], 1
        times = self._times(rng, pair, boundary)
        if times > 1:
            self.base, side, boundary, self.times = self._repeated(rng, pair, boundary, times)
            work += EMBEDDING_WORK * (self.times - 1)
        taken, piece = pieces(side, pair.sides[1], boundary)
        parts = int(piece.sum() + (~taken).sum())
        if not self.min_parts <= parts <= self.max_parts:
            return Outcome.TOO_SMALL if parts < self.min_parts else Outcome.TOO_LARGE, work
        if not piece.any() or taken.all():
            return Outcome.NOTHING_ATTACHED, work
        self._turns -= 1
        if not (self._by_meaning or self.blends or self.most > 1):
            key = int(result_key(side.graph, pair.sides[1].graph, taken, piece, boundary))
            if key in self.known:
                return Outcome.KNOWN, work
            self.known.add(key)
        work += EMBEDDING_WORK
        exchanged, found = Exchanged(taken, piece), None
        if not self._by_meaning:
            found = self._rigidly(rng, side, pair.sides[1], boundary, exchanged)
        elif not ((self.blends or self.most > 1) and rng.random() < BLENDED):
            found = self._by_meanings(rng, pair, exchanged)
        if found is None and (self.blends or self.most > 1):
            work += EMBEDDING_WORK
            if not is_oriented_alike(self.answers.kit, side, pair.sides[1], boundary):
                return Outcome.ASKEW, work
            found = self._bending(side, pair.sides[1], boundary, exchanged)
        if found is None:
            return Outcome.NO_MATCH, work
        motion, poses, self._docked = found
        self._bent = np.flatnonzero(piece) if motion.ndim == 3 else None
        self._cut, self.stretches = (side, pair.sides[1], boundary), None
        if motion.ndim == 3:
            own = pair.giver.assembly.poses[piece]
            rigid, stretches = split(motion @ own)
            motion = rigid @ invert(own)
            if stretches is not None:
                self.stretches = np.concatenate([stretches, np.tile(np.eye(3), (parts - len(own), 1, 1))])
        self.base = replace(self.base, assembly=replace(self.base.assembly, poses=poses))
        put_together(self.tables, pair.giver, self.base, exchanged, motion, self._docked, ws)
        return Outcome.OK, work

    def _move(self, rng: np.random.Generator, pair: Pair, number: int, ws: Workspace) -> tuple[int, float]:
        """Carry out a replacement along a motion, in the workspace: the outcome and the work."""
        assert pair.moves is not None, "numbers are of moves until operations are listed"
        base, giver = (each.graph for each in pair.sides)
        moves, types = pair.moves, [each.assembly.types for each in pair.sides]
        motion, chosen = moves.draw(rng, number)
        is_consistent = make_consistent(
            rng, self.tables, base, giver, *types, moves.regions[motion], moves.images[motion], chosen
        )
        if not is_consistent:
            return Outcome.GRAMMAR, 0.0
        move = moves.along(motion, chosen)
        if not move.piece.any() and not move.taken.any():
            return Outcome.KNOWN, 0.0
        self.base, self.times = pair.base, 1
        parts = int(move.piece.sum() + (~move.taken).sum())
        if not self.min_parts <= parts <= self.max_parts:
            return Outcome.TOO_SMALL if parts < self.min_parts else Outcome.TOO_LARGE, 0.0
        key = int(moved_key(base, giver, move.taken, move.piece, move.image))
        if key in self.known:
            return Outcome.KNOWN, 0.0
        self.known.add(key)
        self._turns -= 1
        poses = pair.giver.assembly.poses
        self._docked = move.docked(giver, poses)
        self._bent = self._cut = self.stretches = None
        told = self._docked if move.piece.any() else move.left(base, poses)
        put_together(self.tables, pair.giver, self.base, Exchanged(move.taken, move.piece), move.motion, told, ws)
        return Outcome.OK, EMBEDDING_WORK

    def _times(self, rng: np.random.Generator, pair: Pair, boundary: np.ndarray) -> int:
        """How often to carry out an operation: a recursive rule at random, as often as limits allow; others once."""
        if self.max_repeats == 1 or self._by_meaning or pair.giver is not pair.base:
            return 1
        parts, growth = len(pair.base.assembly), growth_of(pair.sides[0].graph, boundary)
        room = self.max_parts - parts if growth > 0 else parts - self.min_parts
        return 1 + int(rng.random() * min(self.max_repeats, room // abs(growth))) if growth else 1

    def _repeated(
        self, rng: np.random.Generator, pair: Pair, boundary: np.ndarray, times: int
    ) -> tuple[Parent, Side, np.ndarray, int]:
        """What a recursive rule makes of the base in all times but the last, along which boundary it can be carried out
        then, and how many times these are in all: fewer than asked for where it cannot be carried out so often."""
        side, giver = pair.sides
        base, cut, done = pair.base, boundary, 1
        if growth_of(giver.graph, boundary) < 0:
            farther = boundary[:, 0]
            while done < times and (beyond := cut_farther(giver.graph, boundary, farther)) is not None:
                farther, done = beyond, done + 1
            return base, side, np.stack([farther, boundary[:, 1]], axis=1), done
        while done < times:
            taken, piece = pieces(side, giver, cut)
            found = self._rigidly(rng, side, giver, cut, Exchanged(taken, piece))
            made = None if found is None else replace_piece(side.graph, giver.graph, cut)
            again = None if made is None else cut_again(made, giver.graph, boundary)
            if found is None or made is None or again is None:
                break
            base = self._inflated(base, pair.giver, Exchanged(taken, piece), made.graph, found)
            side, cut, done = Side(base.assembly, made.graph), again, done + 1
        return base, side, cut, done

    def _inflated(self, base: Parent, giver: Parent, exchanged: Exchanged, graph: OrderedGraph, found: Found) -> Parent:
        """The base with a piece put in, as the base of the next time: not looked at by any test."""
        stays, comes = ~exchanged.taken, exchanged.piece
        motion, moved, _ = found
        poses = np.concatenate([moved[stays], motion @ giver.assembly.poses[comes]])
        types = np.concatenate([base.assembly.types[stays], giver.assembly.types[comes]])
        origins = np.concatenate([base.origins[stays], giver.origins[comes]])
        assembly, labels = Assembly(types, poses, graph.edges()), graph.docking_labels()
        tables = shape_tables(assembly, labels, len(self.answers.kit.types))
        return replace(base, assembly=assembly, labels=labels, tables=tables, origins=origins)

    def _rigidly(
        self, rng: np.random.Generator, base: Side, giver: Side, boundary: np.ndarray, exchanged: Exchanged
    ) -> Found | None:
        """The motion of the piece, the poses of the base as it makes room, and what docks to what; None where nothing
        does."""
        docked = _docked(base, giver, boundary, exchanged.piece)
        kit, up = self.answers.kit, self.tables.up
        embedding = embed(rng, kit, up, base, giver, boundary, exchanged.taken) if docked else None
        return None if embedding is None else (embedding.motion, embedding.poses, docked)

    def _bending(self, base: Side, giver: Side, boundary: np.ndarray, exchanged: Exchanged) -> Found | None:
        """The same where each part of the piece has a motion of its own, affine where pieces may be stretched; the base
        stays where it is."""
        docked, kit, piece = _docked(base, giver, boundary, exchanged.piece), self.answers.kit, exchanged.piece
        if not docked:
            return None
        motions, up = None, self.tables.up
        if self.most > 1:
            motions = stretch_onto(kit, base, giver, boundary, piece, self.most, up, self._rigid)
        if motions is None and self.blends:
            motions = blend(kit, base, giver, boundary, piece)
        return None if motions is None else (motions, base.assembly.poses, docked)

    def predict(self, ws: Workspace) -> None:
        """Add the contacts that the operation says the piece has, in it and across its boundary, with the labels that
        they had in the giver: of what is stretched no answer by relative pose can be had."""
        assert self._cut is not None, "nothing was tried yet"
        giver, (base, given, boundary) = self.choice.a, self._cut
        ends = ws.from_a[giver.assembly.edges]
        inner = (ends >= 0).all(axis=1)
        found = np.concatenate([ends[inner], giver.labels[inner]], axis=1).tolist()
        for dart, image in boundary[(boundary >= 0).all(axis=1)].tolist():
            back = int(given.graph.twins[image])
            hold, part = ws.from_b[base.graph.tails[dart]], ws.from_a[given.graph.tails[back]]
            found.append((part, hold, int(given.graph.labels[back]) - 1, int(given.graph.labels[image]) - 1))
        for each in found:
            set_edge(ws.stamp, ws.label, ws.edges, ws.counts, *each)

    def _by_meanings(self, rng: np.random.Generator, pair: Pair, exchanged: Exchanged) -> Found | None:
        """The same where parts of one label are other meshes: a docking of one of them, fitted to all."""
        base, giver, kit, up = pair.base.assembly, pair.giver.assembly, self.answers.kit, self.tables.up
        found = find_motion(rng, kit.label_of, self.answers.dockings, giver, base, exchanged)
        if found is None or (up >= 0 and found[0][up, up] < UPRIGHT):
            return None
        return found[0], base.poses, found[1]

    @property
    def is_bent(self) -> bool:
        """Whether the parts of the piece moved each by itself, so that the contacts between them are to be found."""
        return self._bent is not None

    def is_joined(self, ws: Workspace) -> bool:
        """Whether, once contacts are found, every boundary part touches its new neighbour (§4.2), and a bent piece
        holds together as it did."""
        ends = [(ws.from_a[inner], ws.from_b[hold]) for inner, hold, _ in self._docked]
        if self._bent is not None:
            edges = self.choice.a.assembly.edges
            ends += ws.from_a[edges[np.isin(edges, self._bent).all(axis=1)]].tolist()
        return all(ws.stamp[i, j] == ws.counts[TRY] for i, j in ends)

    def _opened(self, rng: np.random.Generator, choice: PlannedTry) -> tuple[Pair, float]:
        """Two shapes, or the first twice, with some of what can be replaced between them in random order; what is left
        of it where the pair was drawn before, or more of it where nothing is; and what that cost."""
        if rng.random() < WITHIN:
            choice = replace(choice, b=choice.a)
        key = id(choice.b), id(choice.a)  # of shapes that the pair itself keeps
        self._turns, work = DRAWS, 0.0
        if key in self._open:
            pair = replace(self._open.pop(key), choice=choice)
        else:
            graph_of = contact_graph if self._moves else docking_graph
            base = _side(self.answers.kit, choice.b, graph_of)
            giver = base if choice.a is choice.b else _side(self.answers.kit, choice.a, graph_of)
            pair = Pair(choice, (base, giver), [])
        if not pair.left:
            pair, work = self._listed(rng, pair)
        self._open[key] = pair
        if len(self._open) > MOST_OPEN:
            del self._open[next(iter(self._open))]
        return pair, work

    def _listed(self, rng: np.random.Generator, pair: Pair) -> tuple[Pair, float]:
        """A pair of which nothing is left with more that can be replaced, if there is more, in random order; and what
        that cost: moves, in lists that are longer each time until one is whole, then operations."""
        kit, (base, giver) = self.answers.kit, pair.sides
        if self._moves and (pair.moves is None or not pair.moves.is_whole) and pair.reach < MOST_WORK:
            reach = min(DEEPER * pair.reach, MOST_WORK)
            moves = find_region_swaps(
                kit, self.tables.up, (base.assembly, base.graph), (giver.assembly, giver.graph), reach
            )
            return replace(pair, moves=moves, reach=reach, left=moves.order(rng)), self._listing(moves)
        if pair.operations is not None or (self._moves and self._ordered > self._share * self._work):
            return pair, 0.0
        if self._moves:
            base = _side(kit, pair.base, docking_graph)
            giver = base if pair.giver is pair.base else _side(kit, pair.giver, docking_graph)
        operations = find_operations(base.graph, giver.graph, self.dummy_edges, self._by_docking)
        left = _order(rng, operations, len(operations) * (2 if base is giver else 1))
        return replace(pair, sides=(base, giver), operations=operations, left=left), self._listing(operations)

    def _listing(self, found: Operations | RegionSwaps) -> float:
        """What a list cost; as much time is given to what it has."""
        work = found.work / DARTS_A_TRY
        self.lists["whole" if found.is_whole else "cut short"] += 1
        self._turns = max(DRAWS, round(work / EMBEDDING_WORK))
        return work


def _order(rng: np.random.Generator, operations: Operations, ways: int) -> list[int]:
    """The numbers of a pair in random order, from the last on, those without dummy edges, which are few, and the others
    by turns."""
    numbers = rng.permutation(ways)
    is_plain = numbers % max(len(operations), 1) < operations.plain
    rank = np.where(is_plain, 2 * np.cumsum(is_plain), 2 * np.cumsum(~is_plain) + 1)
    order: list[int] = numbers[np.argsort(-rank, kind="stable")].tolist()
    return order


def _side(kit: Kit, parent: Parent, graph_of: Callable[[Kit, Assembly, IntArray], OrderedGraph]) -> Side:
    return Side(parent.assembly, graph_of(kit, parent.assembly, parent.labels))


def _docked(base: Side, giver: Side, boundary: np.ndarray, piece: np.ndarray) -> Docked:
    """The parts of the piece at its boundary, each with the part of the base that it docks to, and its pose there."""
    docked: Docked = []
    for dart, image in boundary[(boundary >= 0).all(axis=1)].tolist():
        hold, inner = int(base.graph.tails[dart]), int(giver.graph.tails[giver.graph.twins[image]])
        if piece[inner]:
            docked.append((inner, hold, giver.assembly.poses[inner]))
    return docked
