"""Every replacement in a small graph by trying all: an oracle that shares no idea with the code that it judges.

A piece is a connected set of nodes whose cut edges follow each other in one cycle, walking round its border. Two can
take each other's place if, walking round both outsides at once, from cut edge to cut edge, the same is met: nodes of
the same types with as many docking sites. Less is asked where only the nodes at the cut must be the same.

Then both outsides can match in two ways at once: a closed ring of parts all alike takes one more,
turned by none at one end of it and by one at the other. No partial symmetry, which lays each part upon one, has such
a boundary; `lies_one_way` tells it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from stages.variations.substructures.ordered_graph import OrderedGraph, ordered_graph
from tests.stages.variations.substructures.graphs import code

Orders = list[list[int]]
Cut = tuple[int, int]
"""A cut edge: the node inside and that outside."""
Outside = tuple[tuple[object, ...], ...]


@dataclass(frozen=True)
class Piece:
    """inside: its nodes; cuts: its cut edges in the order of the walk; outsides: for each cut edge what is met outside
    from there to the next cut edge, and at which place of the walk that one is."""

    inside: frozenset[int]
    cuts: tuple[Cut, ...]
    outsides: tuple[tuple[tuple[int, ...], int], ...]


def orders_of(graph: OrderedGraph) -> Orders:
    return [graph.neighbours(node) for node in range(len(graph.types))]


def results(
    graph: OrderedGraph, giver: OrderedGraph, *, same_outside: bool, one_way: bool = False
) -> set[tuple[tuple[int, ...], ...]]:
    """The codes of all that comes of replacing a piece of the graph by one of the giver, where that is simple."""
    found = set()
    theirs: dict[Outside, list[tuple[Piece, int]]] = {}
    others = list(pieces(giver))
    for other in others:
        for turn in range(len(other.cuts)):
            theirs.setdefault(_met(other, turn, same_outside), []).append((other, turn))
    for piece in others if graph is giver else pieces(graph):
        for other, turn in theirs.get(_met(piece, 0, same_outside), ()):
            if matches(graph, giver, piece, other, turn, same_outside=same_outside):
                made = replaced(graph, giver, piece, other, turn)
                key = None if made is None else code(made)
                if key is None or key in found:
                    continue
                if not one_way or lies_one_way(graph, giver, piece, other, turn):
                    found.add(key)
    return found


def _met(piece: Piece, turn: int, same_outside: bool) -> Outside:
    """What is met outside, walking round from one cut edge on: what two pieces must have in common."""
    count = len(piece.cuts)
    walk = [(place + turn) % count for place in range(count)]
    return tuple(
        (piece.outsides[at][0], (piece.outsides[at][1] - at) % count) if same_outside else piece.outsides[at][0][:2]
        for at in walk
    )


def pieces(graph: OrderedGraph) -> Iterator[Piece]:
    """All pieces of a graph but the whole."""
    orders = orders_of(graph)
    types = graph.types.tolist()
    n = len(types)
    for mask in range(1, (1 << n) - 1):
        inside = frozenset(node for node in range(n) if mask >> node & 1)
        if _is_connected(orders, inside):
            cuts = _round(orders, inside)
            if len(cuts) == sum(other not in inside for node in inside for other in orders[node]):
                yield Piece(inside, cuts, tuple(_outside(types, orders, inside, cuts, cut) for cut in cuts))


def round_outside(piece: Piece) -> Piece | None:
    """The piece with its cut edges in the order of the walk round its outside, None where that is no one cycle."""
    order = [0]
    while len(order) < len(piece.cuts) and (ahead := piece.outsides[order[-1]][1]) != 0:
        order.append(ahead)
    if len(order) < len(piece.cuts):
        return None
    outsides = [(piece.outsides[at][0], order.index(piece.outsides[at][1])) for at in order]
    return Piece(piece.inside, tuple(piece.cuts[at] for at in order), tuple(outsides))


def _is_connected(orders: Orders, nodes: frozenset[int]) -> bool:
    seen, waiting = set(), [min(nodes)]
    while waiting:
        node = waiting.pop()
        if node not in seen:
            seen.add(node)
            waiting.extend(other for other in orders[node] if other in nodes)
    return seen == nodes


def _after(orders: Orders, node: int, other: int) -> int:
    around = orders[node]
    return around[(around.index(other) + 1) % len(around)]


def _round(orders: Orders, inside: frozenset[int]) -> tuple[Cut, ...]:
    """One cycle of cut edges, from the first there is."""
    first = next((node, other) for node in sorted(inside) for other in orders[node] if other not in inside)
    cuts, at = [first], first
    while True:
        node, other = at[0], _after(orders, *at)
        while other in inside:
            node, other = other, _after(orders, other, node)
        at = node, other
        if at == first:
            return tuple(cuts)
        cuts.append(at)


def _outside(
    types: list[int], orders: Orders, inside: frozenset[int], cuts: tuple[Cut, ...], cut: Cut
) -> tuple[tuple[int, ...], int]:
    back, node = cut
    met = [types[node], len(orders[node])]
    while True:
        ahead = _after(orders, node, back)
        if ahead in inside:
            return tuple(met), cuts.index((ahead, node))
        back, node = node, ahead
        met += [types[node], len(orders[node])]


def matches(
    graph: OrderedGraph, giver: OrderedGraph, piece: Piece, other: Piece, turn: int, *, same_outside: bool
) -> bool:
    """Whether the same is met outside both, or at least at the cuts; a node there always stands for the same one."""
    count = len(piece.cuts)
    stands_for: dict[int, tuple[int, int]] = {}
    for place in range(count):
        met, ahead = piece.outsides[place]
        met_there, ahead_there = other.outsides[(place + turn) % count]
        if met[:2] != met_there[:2]:
            return False
        if same_outside and (met != met_there or (ahead + turn) % count != ahead_there):
            return False
        (inner, node), (inner_there, node_there) = piece.cuts[place], other.cuts[(place + turn) % count]
        around, around_there = graph.neighbours(node), giver.neighbours(node_there)
        shift = (around_there.index(inner_there) - around.index(inner)) % len(around)
        if stands_for.setdefault(node, (node_there, shift)) != (node_there, shift):
            return False
    return len({there for there, _ in stands_for.values()}) == len(stands_for)


def lies_one_way(graph: OrderedGraph, giver: OrderedGraph, piece: Piece, other: Piece, turn: int) -> bool:
    """Whether no part is laid upon two, nor two upon one, where the parts outside the cuts are laid upon each other and
    all that is alike around them, and so on."""
    waiting: list[tuple[int, int, int]] = []
    for place, (inner, node) in enumerate(piece.cuts):
        inner_there, there = other.cuts[(place + turn) % len(piece.cuts)]
        shift = giver.neighbours(there).index(inner_there) - graph.neighbours(node).index(inner)
        waiting.append((node, there, shift % len(graph.neighbours(node))))
    stands_for: dict[int, tuple[int, int]] = {}
    stands_there: dict[int, int] = {}
    while waiting:
        node, there, shift = waiting.pop(0)
        if stands_for.get(node) == (there, shift):
            continue
        if node in stands_for or there in stands_there:
            return False
        stands_for[node], stands_there[there] = (there, shift), node
        around, around_there = graph.neighbours(node), giver.neighbours(there)
        for place, near in enumerate(around):
            near_there = around_there[(place + shift) % len(around)]
            own, theirs = graph.neighbours(near), giver.neighbours(near_there)
            if graph.types[near] == giver.types[near_there] and len(own) == len(theirs):
                waiting.append((near, near_there, (theirs.index(there) - own.index(node)) % len(own)))
    return True


def replaced(graph: OrderedGraph, giver: OrderedGraph, piece: Piece, other: Piece, turn: int) -> OrderedGraph | None:
    """The graph with the other piece for the first, or None where that is no simple graph."""
    count = len(piece.cuts)
    place_of = {node: place for place, node in enumerate(sorted(set(range(len(graph.types))) - piece.inside))}
    place_there = {node: len(place_of) + place for place, node in enumerate(sorted(other.inside))}
    there = {cut: other.cuts[(place + turn) % count] for place, cut in enumerate(piece.cuts)}
    here = {cut: own for own, cut in there.items()}
    types = [int(graph.types[node]) for node in place_of] + [int(giver.types[node]) for node in place_there]
    orders = [
        [
            place_there[there[neighbour, node][0]] if neighbour in piece.inside else place_of[neighbour]
            for neighbour in graph.neighbours(node)
        ]
        for node in place_of
    ]
    orders += [
        [
            place_there[neighbour] if neighbour in other.inside else place_of[here[node, neighbour][1]]
            for neighbour in giver.neighbours(node)
        ]
        for node in place_there
    ]
    if any(len(set(order)) < len(order) for order in orders):
        return None
    return ordered_graph(types, orders)
