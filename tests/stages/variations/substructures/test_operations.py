"""All replacements, and nothing but replacements, against brute force on small graphs."""

from __future__ import annotations

import numpy as np
import pytest

from stages.variations.substructures.operations import MAX_DUMMY_WORK, MAX_WAITING, find_operations
from stages.variations.substructures.ordered_graph import OrderedGraph, ordered_graph
from stages.variations.substructures.recursive_rules import cut_again, cut_farther, growth_of
from stages.variations.substructures.replacement import piece_of, replace_piece
from stages.variations.substructures.result_key import result_key
from tests.stages.variations.substructures import brute_force
from tests.stages.variations.substructures.graphs import code, grid, is_connected, path, random_graph, ring
from tests.stages.variations.substructures.oracle import Code, composed, corpus, judge, made, pair_of


def random_pair(seed: int, most: int) -> tuple[OrderedGraph, OrderedGraph]:
    rng = np.random.default_rng(seed)
    base = random_graph(rng, most)
    return base, base if rng.random() < 0.6 else random_graph(rng, most)


@pytest.mark.parametrize("seed", range(40))
def test_operations_of_small_graphs_are_those_of_brute_force(seed: int) -> None:
    judge(*random_pair(seed, 6))


@pytest.mark.parametrize("kept", corpus(), ids=lambda kept: kept[0])
def test_operations_of_kept_graphs_are_those_of_brute_force(kept: tuple[str, OrderedGraph, OrderedGraph]) -> None:
    judge(*kept[1:])


@pytest.mark.slow
def test_operations_of_five_hundred_pairs_of_up_to_nine_nodes_are_those_of_brute_force() -> None:
    figures = [judge(*pair_of(seed, 9)[1:]) for seed in range(500)]
    assert sum(entry.held for entry in figures) > 3000
    assert sum(sum(entry.made_in) for entry in figures) > 100


def check_boundaries(base: OrderedGraph, giver: OrderedGraph) -> tuple[int, int]:
    """Hold operations with dummy edges against all pairs of pieces whose boundaries alone agree; how many results these
    have, and how many of them are not listed without dummy edges."""
    wanted = brute_force.results(base, giver, same_outside=False, one_way=True) - {code(base)}
    assert not composed(base, giver, wanted, 2, violations=2)[-1]
    return len(wanted), len(wanted - set(made(base, giver)))


@pytest.mark.parametrize("seed", range(40))
def test_dummy_edges_replace_pieces_with_agreeing_boundaries(seed: int) -> None:
    check_boundaries(*random_pair(seed, 5))


@pytest.mark.slow
def test_dummy_edges_replace_pieces_of_larger_graphs() -> None:
    counts = np.array([check_boundaries(*random_pair(seed, 6)) for seed in range(100, 160)]).sum(axis=0)
    assert counts[0] > 150
    assert counts[1] > 80


TWISTED = [(30, 5), (34, 5), (27, 5), (24, 5)]
"""Seeds of graphs with results that are no composition: all are closed rings of alike parts."""


@pytest.mark.parametrize(("seed", "most"), TWISTED)
def test_operations_missed_by_dummy_edges_match_in_two_ways(seed: int, most: int) -> None:
    base, giver = random_pair(seed, most)
    wanted = brute_force.results(base, giver, same_outside=False) - {code(base)}
    left = composed(base, giver, wanted, 2, violations=3)[-1]
    assert left
    assert not left & brute_force.results(base, giver, same_outside=False, one_way=True)
    assert all(len(entry.neighbours(node)) == 2 for entry in (base, giver) for node in range(len(entry.types)))


def test_ring_takes_an_arc_of_any_length() -> None:
    """Longer than the distance of two that the paper's dummy edges pass over."""
    short, long = ring(0, 1, 2, 3, 4, 5), ring(0, 6, 7, 8, 9, 3, 4, 10)
    wanted = code(ring(0, 6, 7, 8, 9, 3, 4, 5))
    assert wanted not in made(short, long)
    assert wanted in made(short, long, 1)


def test_ring_loses_parts_between_neighbours_of_the_giver() -> None:
    assert code(ring(0, 3, 4, 5)) in made(ring(0, 1, 2, 3, 4, 5), ring(0, 3, 6, 7, 8), 1)


@pytest.mark.parametrize("seed", range(12))
def test_result_key_equals_the_key_of_the_built_graph(seed: int) -> None:
    """Two results of equal codes have equal keys, and that of putting a piece into its own place is the base's."""
    base, giver = random_pair(seed, 6)
    operations, keys = find_operations(base, giver, 1), dict[Code, set[int]]()
    for number in range(len(operations)):
        boundary = operations.boundary(number)
        taken, piece = piece_of(base, boundary[:, 0]), piece_of(giver, boundary[:, 1])
        result = replace_piece(base, giver, boundary)
        if result is None or not is_connected(result.graph):
            continue
        key = int(result_key(base, giver, taken, piece, boundary))
        whole = np.zeros(len(result.graph.types), dtype=bool)
        none = np.empty((0, 2), dtype=np.int64)
        assert key == int(result_key(result.graph, giver, whole, np.zeros(len(giver.types), dtype=bool), none))
        keys.setdefault(code(result.graph), set()).add(key)
    assert all(len(entry) == 1 for entry in keys.values())


def test_cut_short_lists_are_marked_and_complete_without_dummy_edges() -> None:
    graph = grid(12, 12)
    plain, most = find_operations(graph, graph), find_operations(graph, graph, 2)
    assert plain.is_whole
    assert plain.plain == len(plain)
    assert not most.is_whole
    assert most.plain == len(plain)
    np.testing.assert_array_equal(most.pairs[: len(plain.pairs)], plain.pairs)


def test_chain_grows_and_shrinks_by_links() -> None:
    lengths = {len(entry.types) for entry in made(path(0, 1, 1, 1, 0), path(0, 1, 1, 1, 0)).values()}
    assert lengths >= {3, 4, 6, 7}


def test_ring_takes_parts_of_a_longer_ring() -> None:
    assert code(ring(*[0] * 7)) in made(ring(*[0] * 5), ring(*[0] * 7))


def test_dummy_edge_passes_over_an_arc() -> None:
    short, long = ring(0, 1, 2, 3, 4, 5), ring(0, 1, 9, 8, 3, 4, 6)
    wanted = code(ring(0, 1, 9, 8, 3, 4, 5))
    assert wanted not in made(short, long)
    assert wanted in made(short, long, 1)


def test_dummy_edge_passes_over_a_missing_site() -> None:
    """Two rows of cells that differ at their ends; one lacks a stud in the middle."""

    def row(*, stud: bool, end: int) -> OrderedGraph:
        orders = [[1], [0, 2, 4] if stud else [0, 2], [1, 3], [2], *([[1]] if stud else [])]
        return ordered_graph([0, 1, 2, end, *([5] if stud else [])], orders)

    wanted = code(row(stud=True, end=4))
    base, giver = row(stud=True, end=3), row(stud=False, end=4)
    seeds = find_operations(base, giver, 1)
    results = [replace_piece(base, giver, seeds.boundary(number)) for number in range(len(seeds))]
    assert wanted in {code(entry.graph) for entry in results if entry is not None and is_connected(entry.graph)}


def test_equivalent_operations_are_listed_once() -> None:
    """The ends of 1-2-3 and 1-2-4 take each other's places in one way from three pairs of darts, and both ends, the
    other way round, from two."""
    one, two = (ordered_graph([1, 2, end], [[1], [0, 2], [1]]) for end in (3, 4))
    operations = find_operations(one, two)
    assert (len(operations), operations.meetings) == (3, 3 * 1 + 2 * 2)


def test_waiting_symmetries_of_a_hub_are_bounded() -> None:
    """Two hubs of other types, each with 24 alike neighbours that have two leaves: what may go on beyond the hub is any
    neighbour at any other, and then any of the others."""

    def hub(kind: int) -> OrderedGraph:
        orders = [list(range(1, 25)), *([0, 2 * at + 23, 2 * at + 24] for at in range(1, 25))]
        orders += [[at] for at in range(1, 25) for _ in range(2)]
        return ordered_graph([kind, *[1] * 24, *[2] * 48], orders)

    one, two = hub(5), hub(6)
    operations = find_operations(one, two, 3)
    assert len(operations) <= MAX_WAITING * len(one.types)
    assert operations.work - find_operations(one, two).work <= MAX_DUMMY_WORK + 2 * (len(one.tails) + len(two.tails))


@pytest.mark.parametrize("violations", [0, 1])
def test_same_operation_is_listed_once(violations: int) -> None:
    operations = find_operations(graph := grid(4, 3), graph, violations)
    boundaries = [frozenset(map(tuple, operations.boundary(number).tolist())) for number in range(len(operations))]
    assert len(set(boundaries)) == len(boundaries) > 10
    turned = [frozenset((e, d) for d, e in entry) for entry in boundaries]
    assert all(back not in boundaries or back == entry for entry, back in zip(boundaries, turned, strict=True))


def rules(graph: OrderedGraph) -> list[np.ndarray]:
    """The boundaries of all operations of a graph, both ways, that are recursive rules."""
    operations = find_operations(graph, graph)
    ways = [operations.boundary(number)[:, ::way] for number in range(len(operations)) for way in (1, -1)]
    return [entry for entry in ways if growth_of(graph, entry)]


def grown(graph: OrderedGraph, boundary: np.ndarray, times: int) -> OrderedGraph | None:
    result, cut = replace_piece(graph, graph, boundary), boundary
    for _ in range(times - 1):
        again = None if result is None else cut_again(result, graph, boundary)
        if result is None or again is None:
            return None
        cut = again
        result = replace_piece(result.graph, graph, cut)
    return None if result is None else result.graph


def test_growing_rule_is_repeated() -> None:
    chain = path(0, 1, 2, 1, 2, 1, 0)
    wanted = [code(path(0, *[1, 2] * count, 1, 0)) for count in (3, 4, 5)]
    ways = [entry for entry in rules(chain) if growth_of(chain, entry) == 2]
    made_by = [[grown(chain, entry, times) for times in (1, 2, 3)] for entry in ways]
    assert wanted in [[code(entry) for entry in row if entry is not None] for row in made_by]


def test_shrinking_rule_takes_out_several_periods_at_once() -> None:
    chain = path(0, *[1, 2] * 5, 1, 0)
    ways = [entry for entry in rules(chain) if growth_of(chain, entry) == -2]
    found = 0
    for boundary in ways:
        cut, lengths = boundary[:, 0], []
        while cut is not None:
            result = replace_piece(chain, chain, np.stack([cut, boundary[:, 1]], axis=1))
            assert result is not None
            assert code(result.graph) == code(path(0, *[1, 2] * (4 - len(lengths)), 1, 0))
            lengths.append(len(result.graph.types))
            cut = cut_farther(chain, boundary, cut)
        found = max(found, len(lengths))
    assert found >= 4


@pytest.mark.parametrize(("width", "depth"), [(9, 2), (8, 3)])
def test_shrinking_rule_takes_equal_periods_along_its_boundary(width: int, depth: int) -> None:
    """In grids whose columns are alike, but for the first and the last: a cut goes across, through every row."""
    graph = grid(width, depth, [min(x, 1) + (x == width - 1) for _ in range(depth) for x in range(width)])
    most: dict[int, int] = {}
    for boundary in rules(graph):
        period = -growth_of(graph, boundary) // depth
        if period <= 0 or len(boundary) != depth:
            continue
        cut, times = boundary[:, 0], 0
        while (farther := cut_farther(graph, boundary, cut)) is not None:
            cut, times = farther, times + 1
            result = replace_piece(graph, graph, np.stack([cut, boundary[:, 1]], axis=1))
            left = width - (times + 1) * period
            assert result is not None
            types = [min(x, 1) + (x == left - 1) for _ in range(depth) for x in range(left)]
            assert code(result.graph) == code(grid(left, depth, types))
        most[period] = max(most.get(period, 0), times)
    assert most[1] >= 2


def test_operations_without_nested_pieces_are_no_rules() -> None:
    graph = ring(0, 1, 2, 3, 4, 5)
    boundary = np.array([[graph.starts[0], graph.starts[3]], [graph.starts[2] + 1, graph.starts[5] + 1]])
    assert growth_of(graph, boundary) == 0


def test_invalid_graph_is_rejected() -> None:
    with pytest.raises(ValueError, match="node 0 has node 1 around it, but not the other way round"):
        ordered_graph([0, 0], [[1], []])
    with pytest.raises(ValueError, match="occurs twice"):
        ordered_graph([0, 0], [[1, 1], [0]])
