from __future__ import annotations

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stages.strings.decoder import decode
from stages.strings.encoder import Encoded, canonical_string, encode, random_strings
from stages.strings.tokens import make_alphabet, split_tokens
from tests.stages.strings.graphs import ALPHABET, Graph, arrays, connected_graphs, isomorphic, renamed


def assert_stands_for(encoded: Encoded, graph: Graph) -> None:
    """The decoded string is the graph itself, once the string's nodes are given the graph's names."""
    types, edges = graph
    decoded = decode(encoded.string, ALPHABET)
    assert sorted(encoded.nodes.tolist()) == list(range(len(types)))
    assert decoded.types.tolist() == types[encoded.nodes].tolist()
    found = {frozenset(edge) for edge in encoded.nodes[decoded.edges].tolist()}
    assert found == {frozenset(edge) for edge in edges.tolist()}
    assert len(decoded.edges) == len(edges)


@settings(max_examples=150, deadline=None)
@given(connected_graphs(), st.integers(0, 2**32 - 1))
def test_random_strings_decode_to_their_graph(graph: Graph, seed: int) -> None:
    assert_stands_for(encode(*graph, ALPHABET, np.random.default_rng(seed)), graph)


@settings(max_examples=100, deadline=None)
@given(connected_graphs(), st.integers(0, 2**32 - 1))
def test_the_canonical_string_decodes_to_its_graph_and_ignores_node_order(graph: Graph, seed: int) -> None:
    encoded = canonical_string(*graph, ALPHABET)
    assert_stands_for(encoded, graph)
    assert canonical_string(*renamed(graph, np.random.default_rng(seed)), ALPHABET).string == encoded.string


@settings(max_examples=60, deadline=None)
@given(connected_graphs(6), connected_graphs(6))
def test_canonical_strings_are_equal_exactly_for_isomorphic_graphs(first: Graph, second: Graph) -> None:
    same = canonical_string(*first, ALPHABET).string == canonical_string(*second, ALPHABET).string
    assert same == isomorphic(first, second)


def test_all_strings_of_a_small_graph_are_enumerated() -> None:
    """The star with centre A and leaves B, C: from A two orders, from each leaf one walk."""
    graph = (np.array([0, 1, 2], dtype=np.int16), np.array([[0, 1], [0, 2]], dtype=np.int32))
    found = random_strings(*graph, ALPHABET, 50, np.random.default_rng(0))
    assert {encoded.string for encoded in found} == {"A(B)C", "A(C)B", "BAC", "CAB"}


def test_all_strings_of_a_triangle_are_enumerated() -> None:
    """Each broken edge leaves a chain of three, walked from an end or from the middle in two orders."""
    graph = (np.array([0, 1, 2], dtype=np.int16), np.array([[0, 1], [0, 2], [1, 2]], dtype=np.int32))
    found = {encoded.string for encoded in random_strings(*graph, ALPHABET, 50, np.random.default_rng(0))}
    chains = {"A0BC0", "A0CB0", "B0AC0", "B0CA0", "C0AB0", "C0BA0"}
    forks = {"A(B0)C0", "A(C0)B0", "B(A0)C0", "B(C0)A0", "C(A0)B0", "C(B0)A0"}
    assert found == chains | forks


def test_the_strings_of_figure_1_are_encoded() -> None:
    decoded = decode("CDA0(DC)DCDBDCDCD0", ALPHABET)
    found = random_strings(decoded.types, decoded.edges, ALPHABET, 4000, np.random.default_rng(0))
    strings = {encoded.string for encoded in found}
    assert {"CDA0(DC)DCDBDCDCD0", "A0(DC)(DC)DCDBDCDCD0", "A0(DC)(DCDBDCDCD0)DC"} <= strings


def test_random_strings_are_distinct_and_new() -> None:
    graph = arrays(nx.grid_2d_graph(5, 5))
    rng = np.random.default_rng(1)
    first = {encoded.string for encoded in random_strings(*graph, ALPHABET, 40, rng)}
    assert len(first) == 40
    chain = arrays(nx.path_graph(3), np.array([0, 1, 2]))
    assert {encoded.string for encoded in random_strings(*chain, ALPHABET, 9, rng, {"ABC", "CBA"})} == {
        "B(A)C",
        "B(C)A",
    }


def test_a_graph_with_a_single_string_yields_no_others() -> None:
    found = random_strings(*arrays(nx.path_graph(2)), ALPHABET, 8, np.random.default_rng(0))
    assert [encoded.string for encoded in found] == ["AA"]


def test_random_strings_start_at_all_nodes() -> None:
    """Every node is a root and every edge is broken sometimes."""
    types, edges = arrays(nx.cycle_graph(5), np.arange(5))
    found = random_strings(types, edges, ALPHABET, 200, np.random.default_rng(2))
    assert {encoded.string[0] for encoded in found} == set("ABCDE")
    broken = set()
    for encoded in found:
        decoded = decode(encoded.string, ALPHABET)
        cycle = next(token.edge for token in decoded.tokens if token.kind == "cycle")
        broken.add(tuple(sorted(encoded.nodes[decoded.edges[cycle]].tolist())))
    assert len(broken) == 5


def test_equal_generators_encode_equal_strings() -> None:
    graph = arrays(nx.grid_2d_graph(6, 7))
    one, other = (
        [encoded.string for encoded in random_strings(*graph, ALPHABET, 10, np.random.default_rng(5))] for _ in range(2)
    )
    assert one == other
    assert one != [encoded.string for encoded in random_strings(*graph, ALPHABET, 10, np.random.default_rng(6))]


def test_numbers_begin_at_0_and_are_reused() -> None:
    """A chain of triangles needs two numbers, however long it is: one ends where the next begins."""
    graph = nx.Graph()
    for index in range(30):
        nx.add_cycle(graph, [2 * index, 2 * index + 1, 2 * index + 2])
    types, edges = arrays(graph)
    encoded = canonical_string(types, edges, ALPHABET)
    assert_stands_for(encoded, (types, edges))
    assert set(encoded.string) <= set("A()01")


def test_numbers_above_9_and_above_99_follow_smiles() -> None:
    types, edges = arrays(nx.complete_graph(24))
    encoded = canonical_string(types, edges, ALPHABET)
    assert_stands_for(encoded, (types, edges))
    texts = split_tokens(encoded.string)
    assert {"9", "%10", "%99", "%(100)"} <= set(texts)
    assert "%(99)" not in texts
    assert "%09" not in texts


def test_no_node_opens_a_number_that_closes_there() -> None:
    """`A00` would read like an edge from A to itself to anybody who does not count."""
    types, edges = arrays(nx.complete_graph(9))
    for encoded in random_strings(types, edges, ALPHABET, 20, np.random.default_rng(0)):
        numbers = [
            (token.node, token.text) for token in decode(encoded.string, ALPHABET).tokens if token.kind == "cycle"
        ]
        assert len(set(numbers)) == len(numbers)


def test_closing_numbers_come_first_and_opening_ones_follow_in_order_of_their_ends() -> None:
    types, edges = arrays(nx.complete_graph(9))
    for encoded in random_strings(types, edges, ALPHABET, 20, np.random.default_rng(0)):
        decoded = decode(encoded.string, ALPHABET)
        for node in range(9):
            behind = [token for token in decoded.tokens if token.kind == "cycle" and token.node == node]
            partners = [int(decoded.edges[token.edge].sum()) - node for token in behind]
            pairs = zip(behind, partners, strict=True)
            ending = [int(token.text.strip("%()")) for token, other in pairs if other < node]
            assert ending == sorted(ending)
            assert all(other < node for other in partners[: len(ending)])
            assert partners[len(ending) :] == sorted(partners[len(ending) :])


def test_the_last_subtree_of_a_node_has_no_parentheses() -> None:
    rng = np.random.default_rng(0)
    graph = arrays(nx.balanced_tree(3, 3), rng.integers(0, 6, 40))
    found = [encoded.string for encoded in random_strings(*graph, ALPHABET, 50, rng)]
    assert len(found) == 50
    assert not any("))" in string or string.endswith(")") for string in found)


def test_chains_and_rings_of_5000_nodes_are_encoded() -> None:
    for graph in (nx.path_graph(5000), nx.cycle_graph(5000)):
        types, edges = arrays(graph)
        assert_stands_for(encode(types, edges, ALPHABET, np.random.default_rng(0)), (types, edges))
        assert_stands_for(canonical_string(types, edges, ALPHABET), (types, edges))


def test_bracketed_names_are_written() -> None:
    alphabet = make_alphabet([f"part {index}" for index in range(60)])
    graph = (np.array([59, 3, 59], dtype=np.int16), np.array([[0, 1], [0, 2], [1, 2]], dtype=np.int32))
    encoded = canonical_string(*graph, alphabet)
    decoded = decode(encoded.string, alphabet)
    assert encoded.string == "[part_3]0[part_59][part_59]0"
    assert isomorphic((decoded.types, decoded.edges), graph)


@pytest.mark.parametrize(
    ("types", "edges", "reason"),
    [
        ([], [], "without nodes"),
        ([0, 0, 0], [[0, 1]], "of 3 nodes are reachable"),
        ([0, 6], [[0, 1]], "not in the alphabet"),
        ([0, -1], [[0, 1]], "not in the alphabet"),
        ([0, 0], [[0, 2]], "out of range"),
        ([0, 0], [[-1, 0]], "out of range"),
    ],
)
def test_graphs_that_are_invalid_or_not_connected_are_rejected(
    types: list[int], edges: list[list[int]], reason: str
) -> None:
    graph = np.array(types, dtype=np.int16), np.array(edges, dtype=np.int32).reshape(-1, 2)
    with pytest.raises(ValueError, match=reason):
        encode(*graph, ALPHABET, np.random.default_rng(0))
    with pytest.raises(ValueError, match=reason):
        canonical_string(*graph, ALPHABET)


def assert_spans(encoded: Encoded, graph: Graph) -> None:
    """The decoded string is a spanning tree of the graph."""
    types, edges = graph
    decoded = decode(encoded.string, ALPHABET)
    assert decoded.types.tolist() == types[encoded.nodes].tolist()
    found = nx.Graph(encoded.nodes[decoded.edges].tolist())
    found.add_nodes_from(range(len(types)))
    assert nx.is_tree(found)
    assert {frozenset(edge) for edge in found.edges} <= {frozenset(edge) for edge in edges.tolist()}
    assert not set("0123456789%") & set(encoded.string)


@settings(max_examples=100, deadline=None)
@given(connected_graphs(), st.integers(0, 2**32 - 1))
def test_without_cycles_strings_are_spanning_trees(graph: Graph, seed: int) -> None:
    assert_spans(encode(*graph, ALPHABET, np.random.default_rng(seed), cycles=False), graph)
    canonical = canonical_string(*graph, ALPHABET, cycles=False)
    assert_spans(canonical, graph)
    again = canonical_string(*renamed(graph, np.random.default_rng(seed)), ALPHABET, cycles=False)
    assert again.string == canonical.string


@settings(max_examples=50, deadline=None)
@given(connected_graphs(), st.integers(0, 2**32 - 1))
def test_a_tree_has_the_same_strings_with_and_without_cycles(graph: Graph, seed: int) -> None:
    decoded = decode(encode(*graph, ALPHABET, np.random.default_rng(seed), cycles=False).string, ALPHABET)
    tree = decoded.types, decoded.edges
    for cycles in (True, False):
        one, other = (
            encode(*tree, ALPHABET, np.random.default_rng(seed), with_cycles) for with_cycles in (True, cycles)
        )
        assert one.string == other.string
        assert canonical_string(*tree, ALPHABET, cycles).string == canonical_string(*tree, ALPHABET).string


def test_all_trees_of_a_triangle_are_encoded() -> None:
    graph = (np.array([0, 1, 2], dtype=np.int16), np.array([[0, 1], [0, 2], [1, 2]], dtype=np.int32))
    found = {
        encoded.string for encoded in random_strings(*graph, ALPHABET, 50, np.random.default_rng(0), (), cycles=False)
    }
    chains = {"ABC", "ACB", "BAC", "BCA", "CAB", "CBA"}
    assert found == chains | {"A(B)C", "A(C)B", "B(A)C", "B(C)A", "C(A)B", "C(B)A"}
