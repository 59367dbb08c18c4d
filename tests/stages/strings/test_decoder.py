from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stages.shape.graphs.canonical import graph_digest
from stages.strings.decoder import decode
from stages.strings.tokens import StringError, make_alphabet
from tests.stages.strings.graphs import ALPHABET

FIGURE_1 = ("CDA0(DC)DCDBDCDCD0", "A0(DC)(DC)DCDBDCDCD0", "A0(DC)(DCDBDCDCD0)DC")
FIGURE_1_VARIANT = ("B(DCDCDA0CD)DCDCDC0", "B(DCDCDC0)DCDCDA0CD")
FIGURE_4 = (
    "D(CDADBDA(DC)(DC)(DC)DCDCDCDBDADCDC0)CD0",
    "CDA(DC)(DC)(DCDCDCDBDADCDC0)DBDADCDCD0",
    "D(A(DC)(DC)(DC)DCDCDCDBDADCDC0)BDADCDCD0",
)


def equivalent(first: str, second: str) -> bool:
    """Return whether two strings encode isomorphic shape graphs."""
    graphs = [decode(string, ALPHABET) for string in (first, second)]
    return len({graph_digest(graph.types, graph.edges) for graph in graphs}) == 1


def edges(string: str) -> list[list[int]]:
    return [[i, j] for i, j in decode(string, ALPHABET).edges.tolist()]


def test_a_chain_connects_consecutive_nodes() -> None:
    decoded = decode("ABCA", ALPHABET)
    assert decoded.types.tolist() == [0, 1, 2, 0]
    assert decoded.types.dtype == np.int16
    assert decoded.edges.tolist() == [[0, 1], [1, 2], [2, 3]]
    assert decoded.edges.dtype == np.int32


def test_one_node_is_a_graph() -> None:
    decoded = decode("C", ALPHABET)
    assert decoded.types.tolist() == [2]
    assert decoded.edges.shape == (0, 2)


def test_branches_connect_to_the_preceding_node() -> None:
    assert edges("A(B)(C(A)B)C") == [[0, 1], [0, 2], [0, 5], [2, 3], [2, 4]]


def test_numbers_close_cycles() -> None:
    assert edges("A0BCD0") == [[0, 1], [0, 3], [1, 2], [2, 3]]


def test_edges_are_in_lexicographic_order_with_the_lower_node_first() -> None:
    assert edges("A01B(C2)D0E2F1") == [[0, 1], [0, 3], [0, 5], [1, 2], [1, 3], [2, 4], [3, 4], [4, 5]]


def test_a_branch_may_be_the_last_child_of_its_node() -> None:
    assert edges("A(B)(C)") == edges("A(B)C")


@pytest.mark.parametrize("string", ["A0BC0", "A7BC7", "A%00BC0", "A%(0)BC%00", "A%10BC%(010)", "A%(123456)BC%(123456)"])
def test_all_notations_of_a_number_are_read(string: str) -> None:
    assert edges(string) == [[0, 1], [0, 2], [1, 2]]


def test_a_number_is_reused_after_its_cycle_closes() -> None:
    triangles = [[0, 1], [0, 2], [1, 2], [2, 3], [3, 4], [3, 5], [4, 5]]
    assert edges("A0AA0A0AA0") == triangles == edges("A0AA0A1AA1")
    assert edges("A0AA00AA0") == [[0, 1], [0, 2], [1, 2], [2, 3], [2, 4], [3, 4]]


def test_a_percent_sign_precedes_two_digits() -> None:
    assert edges("A%123BC%12D3") == [[0, 1], [0, 2], [0, 3], [1, 2], [2, 3]]


def test_bracketed_names_are_tokens() -> None:
    alphabet = make_alphabet([f"part {index}" for index in range(60)])
    decoded = decode("[part_59]0([part_1])[part_2][part_1]0", alphabet)
    assert decoded.types.tolist() == [59, 1, 2, 1]
    assert decoded.edges.tolist() == [[0, 1], [0, 2], [0, 3], [2, 3]]


def test_figure_1_is_two_shapes() -> None:
    """strings, figure 1: three strings of the input shape and two of a variant."""
    shapes = [decode(string, ALPHABET) for string in FIGURE_1]
    assert {(len(shape.types), len(shape.edges)) for shape in shapes} == {(14, 14)}
    assert all(equivalent(FIGURE_1[0], string) for string in FIGURE_1)
    assert equivalent(*FIGURE_1_VARIANT)
    assert not equivalent(FIGURE_1[0], FIGURE_1_VARIANT[0])


def test_figure_4_is_one_shape() -> None:
    assert all(equivalent(FIGURE_4[0], string) for string in FIGURE_4)
    assert len(edges(FIGURE_4[0])) == 30


def test_figure_9_has_one_cycle_of_towers() -> None:
    decoded = decode("B(D)C(AC(BD)AC(AC0BD)BD)AC(AC(BD)A0)BD", ALPHABET)
    assert len(decoded.edges) == len(decoded.types) == 24
    cycle = next(token.edge for token in decoded.tokens if token.kind == "cycle")
    assert sorted(decoded.types[decoded.edges[cycle]].tolist()) == [0, 2]  # the numbers stand behind a C and an A


def test_strings_with_equal_counts_of_different_graphs_are_not_equivalent() -> None:
    assert not equivalent("A(B)AAA(B)A", "A(B)AA(B)AA")
    assert equivalent("ABC", "CBA")
    assert not equivalent("ABC", "ACB")


def test_tokens_have_their_nodes_and_edges() -> None:
    decoded = decode("A%10(BC)DE%10", ALPHABET)
    assert decoded.edges.tolist() == [[0, 1], [0, 3], [0, 4], [1, 2], [3, 4]]
    assert [(token.index, token.text, token.kind, token.node, token.edge) for token in decoded.tokens] == [
        (0, "A", "node", 0, -1),
        (1, "%10", "cycle", 0, 2),
        (4, "(", "open", -1, -1),
        (5, "B", "node", 1, 0),
        (6, "C", "node", 2, 3),
        (7, ")", "close", -1, -1),
        (8, "D", "node", 3, 1),
        (9, "E", "node", 4, 4),
        (10, "%10", "cycle", 4, 2),
    ]


@pytest.mark.parametrize(
    ("string", "index", "reason"),
    [
        ("", 0, "the string is empty"),
        ("AxB", 1, "unknown token 'x'; the alphabet is A, B, C to F"),
        ("A B", 1, "unknown token ' '"),
        ("AB\n", 2, "unknown token"),
        ("A[B]", 1, r"unknown token '\[B\]'"),
        ("A[B", 1, r"unknown token '\['"),
        ("A٣B", 1, "unknown token '٣'"),
        ("(A)B", 0, "cannot begin with a branch"),
        ("A((B))C", 2, "must begin with a node"),
        ("A()B", 2, "branch is empty"),
        ("AB)", 2, "no branch is open"),
        (")", 0, "no branch is open"),
        ("A(B(C)D", 1, "branch is not closed"),
        ("A(", 1, "branch is not closed"),
        ("0AB0", 0, "must follow its node"),
        ("A(B)0CD0", 4, "must follow its node"),
        ("A(0B)C0", 2, "must follow its node"),
        ("AB0CD1E1", 2, "cycle number 0 occurs only once"),
        ("A1B0C1D3", 3, "cycle number 0 occurs only once"),
        ("AB0", 2, "cycle number 0 occurs only once"),
        ("A00B", 2, "from a node to itself"),
        ("A0B0C", 3, "two edges join"),
        ("A01BCD01", 7, "two edges join"),
        ("A%B", 1, "% must precede two digits"),
        ("A%1B", 1, "% must precede two digits"),
        ("AB%", 2, "% must precede two digits"),
        ("A%()B", 1, "% must precede two digits"),
        ("A%(12B", 1, "% must precede two digits"),
        ("A%(1234567)B", 1, "% must precede two digits"),
    ],
)
def test_invalid_strings_are_rejected_at_the_character(string: str, index: int, reason: str) -> None:
    with pytest.raises(StringError, match=reason) as caught:
        decode(string, ALPHABET)
    assert caught.value.index == index
    assert caught.value.string == string


def test_errors_show_the_string_with_a_caret() -> None:
    with pytest.raises(StringError) as caught:
        decode("CDA0(DC)X", ALPHABET)
    reason, string, caret = str(caught.value).split("\n")
    assert reason.startswith("unknown token 'X'")
    assert string[caret.index("^")] == "X"
    assert string.strip() == "CDA0(DC)X"


def test_errors_in_long_strings_show_an_excerpt() -> None:
    string = "A" * 500 + "X" + "A" * 500
    with pytest.raises(StringError) as caught:
        decode(string, ALPHABET)
    _, shown, caret = str(caught.value).split("\n")
    assert len(shown) < 130
    assert shown.count("…") == 2
    assert shown[caret.index("^")] == "X"


def test_errors_at_the_end_have_a_caret_after_the_string() -> None:
    assert str(StringError("A(", 2, "more is missing")).endswith("\n  A(\n    ^")


def test_errors_can_be_pickled() -> None:
    error = pickle.loads(pickle.dumps(StringError("A(", 1, "the branch is not closed")))
    assert (error.string, error.index, error.reason) == ("A(", 1, "the branch is not closed")


def test_branches_may_nest_deeper_than_the_recursion_limit() -> None:
    depth = 5000
    decoded = decode("A" + "(A" * depth + ")" * depth, ALPHABET)
    assert decoded.edges.tolist() == [[index, index + 1] for index in range(depth)]


@settings(max_examples=300, deadline=None)
@given(st.text(alphabet="ABCAB0011%()2", max_size=24))
def test_arbitrary_text_decodes_or_raises_at_a_character_of_it(string: str) -> None:
    try:
        decoded = decode(string, ALPHABET)
    except StringError as error:
        assert string[error.index :] or not string  # noqa: PT017  (either outcome is right, each has its own truth)
        return
    keys = decoded.edges @ (1000, 1)
    assert (decoded.edges[:, 0] < decoded.edges[:, 1]).all()
    assert (np.diff(keys) > 0).all()
    assert "".join(token.text for token in decoded.tokens) == string
    assert all(string[token.index :].startswith(token.text) for token in decoded.tokens)
    owners = [token.edge for token in decoded.tokens if token.edge >= 0]
    spanning = {token.edge for token in decoded.tokens if token.kind == "node"} - {-1}
    assert sorted(owners) == sorted([*spanning, *2 * [e for e in range(len(decoded.edges)) if e not in spanning]])
