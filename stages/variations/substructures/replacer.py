"""Replacement, one a call: the operations between two shapes are listed once and carried out one after the other."""

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
from stages.variations.kernels.outcomes import Outcome
from stages.variations.kernels.structs import MIN_UPRIGHT_COSINE, TRY_NUMBER, KitTables, Workspace
from stages.variations.kernels.tables import shape_tables
from stages.variations.kernels.variant_graph import set_edge
from stages.variations.requirements.resizing import rigid_types
from stages.variations.search.operator_selection import PlannedTry
from stages.variations.search.parents import Parent
from stages.variations.settings import SearchConfig
from stages.variations.substitution.pieces import Exchanged
from stages.variations.substitution.substitute import Docked, find_docking, put_together
from stages.variations.substructures.alignments import MAX_WORK, find_region_swaps
from stages.variations.substructures.consistency import make_consistent
from stages.variations.substructures.deformation import deform, is_oriented_alike
from stages.variations.substructures.docking_sites import contact_graph, docking_graph
from stages.variations.substructures.embedding import Side, embed, pieces
from stages.variations.substructures.operations import Operations, find_operations
from stages.variations.substructures.ordered_graph import OrderedGraph
from stages.variations.substructures.recursive_rules import cut_again, cut_farther, growth_of
from stages.variations.substructures.region_swaps import RegionSwaps
from stages.variations.substructures.replacement import replace_piece
from stages.variations.substructures.result_key import result_key, swap_key
from stages.variations.substructures.stretching import stretch_onto

FIRST_WORK, WORK_FACTOR = 1 << 19, 16
"""Parts laid on others when two shapes are first drawn, and the factor of it each time they are drawn again with
nothing left. Alignments under which most coincides come first.
"""
MIN_DRAWS = 48
"""Operations of a pair that are carried out before another pair's turn; more if listing them took longer."""
MAX_OPEN_PAIRS = 16
"""Pairs of shapes whose lists are kept, so that a pair that is drawn again continues."""
EMBEDDING_WORK = 12.0
"""Work of an embedding; a try of the exchange that finds no match has work 1."""
MAX_ORDERED_SHARE, MAX_DEFORMED_SHARE = 0.1, 0.75
"""Largest share of the work for operations by the order of docking sites where alignments are known too. They find what
moves the parts that stay apart, and take long to list. The second holds where pieces may be deformed or stretched,
which only these operations do.
"""
WITHIN_PROBABILITY = 0.25
"""Probability that a shape is laid on itself whatever else was drawn: recursive rules are within one shape."""
DEFORM_PROBABILITY = 0.5
"""Probability that a piece is deformed at once where parts of one label have other meshes: most of these dock somehow.
"""

Placement = tuple[FloatArray, FloatArray, Docked]
"""The transform of the piece (4, 4) or of its parts (k, 4, 4), the poses of the base, and what docks to what."""
DARTS_PER_WORK = 4000.0
"""Darts, and pairs of them, that are looked at in the time of work 1."""


@dataclass(frozen=True)
class OpenPair:
    """Two shapes and what can be replaced between them: region swaps first, operations when no swap is left."""

    planned: PlannedTry
    sides: tuple[Side, Side]  # base and giver
    left: list[int]
    """Numbers of region swaps that are left, or of operations once they are listed. Within one shape the second half of
    the operations is the other way round."""
    swaps: RegionSwaps | None = None
    max_work: int = FIRST_WORK // WORK_FACTOR  # parts laid on others at most when swaps were listed
    operations: Operations | None = None

    @property
    def giver(self) -> Parent:
        return self.planned.a

    @property
    def base(self) -> Parent:
        return self.planned.b


class Replacer:
    """Replaces pieces within limits of size.

    With `matching: pose`, region swaps along alignments come first: they fit without deformation. Afterwards operations
        match edges by dockings, which keeps matched parts rigid. Where types go by meaning, pieces may be stretched, or
        matching is by centroid, edges match by the types at their ends alone.

    After an OK try these describe it:
    base: what the piece was put into: the chosen shape, or what a recursive rule had made of it before the last time
    repeats: how often the operation was carried out
    stretches: float64 (n, 3, 3) of the parts where the piece was stretched, otherwise None

    lists: number of lists that were made, by whether each was `whole` or `cut short`
    known: keys of shapes, by graph and dockings, that need not be put together again
    """

    base: Parent
    repeats = 1
    stretches: FloatArray | None = None

    def __init__(
        self, oracle: ContactOracle, tables: KitTables, min_parts: int, max_parts: int, config: SearchConfig
    ) -> None:
        self.oracle, self.tables = oracle, tables
        self.min_parts, self.max_parts = min_parts, max_parts
        self.dummy_edges, self.max_repeats = config.dummy_edges, config.max_repeats
        self.deforms, self.max_factor = config.deform, config.stretch.max_factor
        kit = oracle.kit
        self._rigid = rigid_types(kit, config.stretch.rigid)
        self._by_meaning = kit.by_meaning
        self._aligns = config.matching == "pose" and not self._by_meaning
        self._may_deform = self.deforms or self.max_factor > 1
        self._by_docking = self._aligns and self.max_factor == 1
        self._max_ordered_share = MAX_DEFORMED_SHARE if self._may_deform else MAX_ORDERED_SHARE
        self.lists: Counter[str] = Counter()
        self.known: set[int] = set()
        self._open: dict[tuple[int, int], OpenPair] = {}
        self._draws_left = 0
        self._work = self._ordered = 0.0
        self._pair: OpenPair | None = None
        self._docked: Docked = []
        self._deformed: np.ndarray | None = None
        self._cut: tuple[Side, Side, np.ndarray] | None = None

    @property
    def planned(self) -> PlannedTry:
        """The try for which the last pair was drawn, with giver `a` and base `b`."""
        assert self._pair is not None, "nothing was tried yet"
        return self._pair.planned

    def replace(self, rng: np.random.Generator, planned: PlannedTry, ws: Workspace) -> tuple[int, float]:
        """Carry out another operation of the current pair, or one between the planned shapes, in the workspace.

        Return the outcome and the work. After OK the contacts between the two must be found by `connect`.
        """
        outcome, work = self._next(rng, planned, ws)
        self._work += work
        if self._pair is not None and self._pair.operations is not None:
            self._ordered += work
        return outcome, work

    def _next(self, rng: np.random.Generator, planned: PlannedTry, ws: Workspace) -> tuple[int, float]:
        work = 1.0
        if self._pair is None or self._draws_left <= 0 or not self._pair.left:
            self._pair, cost = self._opened(rng, planned)
            work += cost
        pair = self._pair
        if not pair.left:  # nothing can be replaced, or everything has been
            return Outcome.KNOWN if pair.operations or pair.swaps else Outcome.NO_MATCH, work
        number = pair.left.pop()
        if pair.operations is None:
            outcome, cost = self._swap(rng, pair, number, ws)
        else:
            outcome, cost = self._operate(rng, pair, pair.operations, number, ws)
        return outcome, work + cost

    def _operate(
        self, rng: np.random.Generator, pair: OpenPair, operations: Operations, number: int, ws: Workspace
    ) -> tuple[int, float]:
        """Carry out an operation along a boundary of docking sites, in the workspace; return outcome and work."""
        work = 0.0
        count = len(operations)
        boundary = operations.boundary(number % count)[:, :: 1 if number < count else -1]
        self.base, side, self.repeats = pair.base, pair.sides[0], 1
        repeats = self._draw_repeats(rng, pair, boundary)
        if repeats > 1:
            self.base, side, boundary, self.repeats = self._repeated(rng, pair, boundary, repeats)
            work += EMBEDDING_WORK * (self.repeats - 1)
        taken, piece = pieces(side, pair.sides[1], boundary)
        parts = int(piece.sum() + (~taken).sum())
        if not self.min_parts <= parts <= self.max_parts:
            return Outcome.TOO_SMALL if parts < self.min_parts else Outcome.TOO_LARGE, work
        if not piece.any() or taken.all():
            return Outcome.NOTHING_ATTACHED, work
        self._draws_left -= 1
        if not (self._by_meaning or self._may_deform):
            key = int(result_key(side.graph, pair.sides[1].graph, taken, piece, boundary))
            if key in self.known:
                return Outcome.KNOWN, work
            self.known.add(key)
        work += EMBEDDING_WORK
        exchanged, placement = Exchanged(taken, piece), None
        if not self._by_meaning:
            placement = self._rigidly(rng, side, pair.sides[1], boundary, exchanged)
        elif not (self._may_deform and rng.random() < DEFORM_PROBABILITY):
            placement = self._by_docking_of_labels(rng, pair, exchanged)
        if placement is None and self._may_deform:
            work += EMBEDDING_WORK
            if not is_oriented_alike(self.oracle.kit, side, pair.sides[1], boundary):
                return Outcome.ASKEW, work
            placement = self._deforming(side, pair.sides[1], boundary, exchanged)
        if placement is None:
            return Outcome.NO_MATCH, work
        transform, poses, self._docked = placement
        self._deformed = np.flatnonzero(piece) if transform.ndim == 3 else None
        self._cut, self.stretches = (side, pair.sides[1], boundary), None
        if transform.ndim == 3:
            own = pair.giver.assembly.poses[piece]
            rigid, stretches = split(transform @ own)
            transform = rigid @ invert(own)
            if stretches is not None:
                self.stretches = np.concatenate([stretches, np.tile(np.eye(3), (parts - len(own), 1, 1))])
        self.base = replace(self.base, assembly=replace(self.base.assembly, poses=poses))
        put_together(self.tables, pair.giver, self.base, exchanged, transform, self._docked, ws)
        return Outcome.OK, work

    def _swap(self, rng: np.random.Generator, pair: OpenPair, number: int, ws: Workspace) -> tuple[int, float]:
        """Swap regions along an alignment, in the workspace; return the outcome and the work."""
        assert pair.swaps is not None, "numbers are of region swaps until operations are listed"
        base, giver = (side.graph for side in pair.sides)
        swaps, types = pair.swaps, [side.assembly.types for side in pair.sides]
        alignment, chosen = swaps.draw(rng, number)
        is_consistent = make_consistent(
            rng, self.tables, base, giver, *types, swaps.regions[alignment], swaps.images[alignment], chosen
        )
        if not is_consistent:
            return Outcome.GRAMMAR, 0.0
        swap = swaps.along(alignment, chosen)
        if not swap.piece.any() and not swap.taken.any():
            return Outcome.KNOWN, 0.0
        self.base, self.repeats = pair.base, 1
        parts = int(swap.piece.sum() + (~swap.taken).sum())
        if not self.min_parts <= parts <= self.max_parts:
            return Outcome.TOO_SMALL if parts < self.min_parts else Outcome.TOO_LARGE, 0.0
        key = int(swap_key(base, giver, swap.taken, swap.piece, swap.image))
        if key in self.known:
            return Outcome.KNOWN, 0.0
        self.known.add(key)
        self._draws_left -= 1
        poses = pair.giver.assembly.poses
        self._docked = swap.docked(giver, poses)
        self._deformed = self._cut = self.stretches = None
        boundary = self._docked if swap.piece.any() else swap.ends(base, poses)
        exchanged = Exchanged(swap.taken, swap.piece)
        put_together(self.tables, pair.giver, self.base, exchanged, swap.transform, boundary, ws)
        return Outcome.OK, EMBEDDING_WORK

    def _draw_repeats(self, rng: np.random.Generator, pair: OpenPair, boundary: np.ndarray) -> int:
        """Draw how often to carry out an operation: a recursive rule within the limits, others once."""
        if self.max_repeats == 1 or self._by_meaning or pair.giver is not pair.base:
            return 1
        parts, growth = len(pair.base.assembly), growth_of(pair.sides[0].graph, boundary)
        room = self.max_parts - parts if growth > 0 else parts - self.min_parts
        return 1 + int(rng.random() * min(self.max_repeats, room // abs(growth))) if growth else 1

    def _repeated(
        self, rng: np.random.Generator, pair: OpenPair, boundary: np.ndarray, repeats: int
    ) -> tuple[Parent, Side, np.ndarray, int]:
        """Carry out a recursive rule all times but the last.

        Return what it makes of the base, the boundary along which it can be carried out again, and how often it is
        carried out including that: at most `repeats`.
        """
        side, giver = pair.sides
        base, cut, done = pair.base, boundary, 1
        if growth_of(giver.graph, boundary) < 0:
            farther = boundary[:, 0]
            while done < repeats and (beyond := cut_farther(giver.graph, boundary, farther)) is not None:
                farther, done = beyond, done + 1
            return base, side, np.stack([farther, boundary[:, 1]], axis=1), done
        while done < repeats:
            taken, piece = pieces(side, giver, cut)
            placement = self._rigidly(rng, side, giver, cut, Exchanged(taken, piece))
            result = None if placement is None else replace_piece(side.graph, giver.graph, cut)
            again = None if result is None else cut_again(result, giver.graph, boundary)
            if placement is None or result is None or again is None:
                break
            base = self._inflated(base, pair.giver, Exchanged(taken, piece), result.graph, placement)
            side, cut, done = Side(base.assembly, result.graph), again, done + 1
        return base, side, cut, done

    def _inflated(
        self, base: Parent, giver: Parent, exchanged: Exchanged, graph: OrderedGraph, placement: Placement
    ) -> Parent:
        """Return the base with a piece put in, as the base of the next time; no test has seen it."""
        stays, comes = ~exchanged.taken, exchanged.piece
        transform, moved, _ = placement
        poses = np.concatenate([moved[stays], transform @ giver.assembly.poses[comes]])
        types = np.concatenate([base.assembly.types[stays], giver.assembly.types[comes]])
        origins = np.concatenate([base.origins[stays], giver.origins[comes]])
        assembly, labels = Assembly(types, poses, graph.edges()), graph.docking_labels()
        tables = shape_tables(assembly, labels, len(self.oracle.kit.types))
        return replace(base, assembly=assembly, labels=labels, tables=tables, origins=origins)

    def _rigidly(
        self, rng: np.random.Generator, base: Side, giver: Side, boundary: np.ndarray, exchanged: Exchanged
    ) -> Placement | None:
        """Return the rigid transform of the piece, the poses of the base as it makes room, and what docks to what, or
        None.
        """
        docked = _docked(base, giver, boundary, exchanged.piece)
        kit, up = self.oracle.kit, self.tables.up
        embedding = embed(rng, kit, up, base, giver, boundary, exchanged.taken) if docked else None
        return None if embedding is None else (embedding.transform, embedding.poses, docked)

    def _deforming(self, base: Side, giver: Side, boundary: np.ndarray, exchanged: Exchanged) -> Placement | None:
        """Return the same where each part has a transform of its own, affine where pieces may be stretched; the base
        stays.
        """
        docked, kit, piece = _docked(base, giver, boundary, exchanged.piece), self.oracle.kit, exchanged.piece
        if not docked:
            return None
        transforms, up = None, self.tables.up
        if self.max_factor > 1:
            transforms = stretch_onto(kit, base, giver, boundary, piece, self.max_factor, up, self._rigid)
        if transforms is None and self.deforms:
            transforms = deform(kit, base, giver, boundary, piece)
        return None if transforms is None else (transforms, base.assembly.poses, docked)

    def predict(self, ws: Workspace) -> None:
        """Add the contacts in the piece and across its boundary, with the labels that they had in the giver.

        The oracle has no answers for stretched parts.
        """
        assert self._cut is not None, "nothing was tried yet"
        giver, (base, given, boundary) = self.planned.a, self._cut
        ends = ws.from_a[giver.assembly.edges]
        inner = (ends >= 0).all(axis=1)
        contacts = np.concatenate([ends[inner], giver.labels[inner]], axis=1).tolist()
        for dart, image in boundary[(boundary >= 0).all(axis=1)].tolist():
            back = int(given.graph.twins[image])
            anchor, part = ws.from_b[base.graph.tails[dart]], ws.from_a[given.graph.tails[back]]
            contacts.append((part, anchor, int(given.graph.labels[back]) - 1, int(given.graph.labels[image]) - 1))
        for contact in contacts:
            set_edge(ws.stamp, ws.label, ws.edges, ws.counts, *contact)

    def _by_docking_of_labels(self, rng: np.random.Generator, pair: OpenPair, exchanged: Exchanged) -> Placement | None:
        """Return the same where parts of one label have other meshes: one docking, fitted to the others."""
        base, giver, kit, up = pair.base.assembly, pair.giver.assembly, self.oracle.kit, self.tables.up
        docking = find_docking(rng, kit.label_of, self.oracle.dockings, giver, base, exchanged)
        if docking is None or (up >= 0 and docking[0][up, up] < MIN_UPRIGHT_COSINE):
            return None
        return docking[0], base.poses, docking[1]

    @property
    def is_deformed(self) -> bool:
        """Whether the parts of the piece moved independently, so that the contacts between them must be found."""
        return self._deformed is not None

    def is_joined(self, ws: Workspace) -> bool:
        """Return whether, once contacts are found, every boundary part touches its new neighbour (§4.2) and the piece
        holds.
        """
        ends = [(ws.from_a[inner], ws.from_b[anchor]) for inner, anchor, _ in self._docked]
        if self._deformed is not None:
            edges = self.planned.a.assembly.edges
            ends += ws.from_a[edges[np.isin(edges, self._deformed).all(axis=1)]].tolist()
        return all(ws.stamp[i, j] == ws.counts[TRY_NUMBER] for i, j in ends)

    def _opened(self, rng: np.random.Generator, planned: PlannedTry) -> tuple[OpenPair, float]:
        """Return two shapes, or the first twice, with replacements between them in random order, and the work.

        A pair that was drawn before continues with what is left of it, or with more of it where nothing is.
        """
        if rng.random() < WITHIN_PROBABILITY:
            planned = replace(planned, b=planned.a)
        key = id(planned.b), id(planned.a)  # of shapes that the pair itself keeps
        self._draws_left, work = MIN_DRAWS, 0.0
        if key in self._open:
            pair = replace(self._open.pop(key), planned=planned)
        else:
            graph_of = contact_graph if self._aligns else docking_graph
            base = _side(self.oracle.kit, planned.b, graph_of)
            giver = base if planned.a is planned.b else _side(self.oracle.kit, planned.a, graph_of)
            pair = OpenPair(planned, (base, giver), [])
        if not pair.left:
            pair, work = self._listed(rng, pair)
        self._open[key] = pair
        if len(self._open) > MAX_OPEN_PAIRS:
            del self._open[next(iter(self._open))]
        return pair, work

    def _listed(self, rng: np.random.Generator, pair: OpenPair) -> tuple[OpenPair, float]:
        """Return a pair with more replacements in random order, if there are any, and the work.

        Lists of region swaps come first, each longer until one is whole, then operations.
        """
        kit, (base, giver) = self.oracle.kit, pair.sides
        if self._aligns and (pair.swaps is None or not pair.swaps.is_whole) and pair.max_work < MAX_WORK:
            max_work = min(WORK_FACTOR * pair.max_work, MAX_WORK)
            shapes = (base.assembly, base.graph), (giver.assembly, giver.graph)
            swaps = find_region_swaps(kit, self.tables.up, *shapes, max_work)
            return replace(pair, swaps=swaps, max_work=max_work, left=swaps.order(rng)), self._listing(swaps)
        if pair.operations is not None or (self._aligns and self._ordered > self._max_ordered_share * self._work):
            return pair, 0.0
        if self._aligns:
            base = _side(kit, pair.base, docking_graph)
            giver = base if pair.giver is pair.base else _side(kit, pair.giver, docking_graph)
        operations = find_operations(base.graph, giver.graph, self.dummy_edges, self._by_docking)
        left = _order(rng, operations, len(operations) * (2 if base is giver else 1))
        return replace(pair, sides=(base, giver), operations=operations, left=left), self._listing(operations)

    def _listing(self, listed: Operations | RegionSwaps) -> float:
        """Return the work of a list; its replacements get the same work."""
        work = listed.work / DARTS_PER_WORK
        self.lists["whole" if listed.is_whole else "cut short"] += 1
        self._draws_left = max(MIN_DRAWS, round(work / EMBEDDING_WORK))
        return work


def _order(rng: np.random.Generator, operations: Operations, ways: int) -> list[int]:
    """Return the numbers of a pair's operations in random order, to be taken from the end.

    Operations without dummy edges, which are few, take turns with the others.
    """
    numbers = rng.permutation(ways)
    is_plain = numbers % max(len(operations), 1) < operations.plain
    rank = np.where(is_plain, 2 * np.cumsum(is_plain), 2 * np.cumsum(~is_plain) + 1)
    order: list[int] = numbers[np.argsort(-rank, kind="stable")].tolist()
    return order


def _side(kit: Kit, parent: Parent, graph_of: Callable[[Kit, Assembly, IntArray], OrderedGraph]) -> Side:
    return Side(parent.assembly, graph_of(kit, parent.assembly, parent.labels))


def _docked(base: Side, giver: Side, boundary: np.ndarray, piece: np.ndarray) -> Docked:
    """Return the parts of the piece at its boundary, the part of the base that each docks to, and its pose in the
    giver.
    """
    docked: Docked = []
    for dart, image in boundary[(boundary >= 0).all(axis=1)].tolist():
        anchor, inner = int(base.graph.tails[dart]), int(giver.graph.tails[giver.graph.twins[image]])
        if piece[inner]:
            docked.append((inner, anchor, giver.assembly.poses[inner]))
    return docked
