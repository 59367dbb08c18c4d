from __future__ import annotations

import pytest

from stages.shape.kit import Grammar
from stages.strings.settings import Edges
from stages.strings.tokens import StringError, make_alphabet
from tests.stages.strings.grammar_check import check_string

ALPHABET = make_alphabet(["tower", "gate", "flag", "wall"])
TOWER, GATE, FLAG, WALL = range(4)

CASTLE = Grammar(
    neighbourhoods={
        TOWER: {((WALL, 2),): 3, ((FLAG, 1), (WALL, 2)): 1},
        FLAG: {((TOWER, 1),): 1},
        WALL: {((TOWER, 2),): 4, ((TOWER, 1), (GATE, 1)): 2},
        GATE: {((WALL, 2),): 1},
    },
    dockings=(),
    nested={},
)
"""Rings of walls between towers, at most one flag on a tower."""


@pytest.mark.parametrize("string", ["A0DADAD0", "A0(C)DADAD0", "CA0DADBDAD0"])
def test_rings_within_the_grammar_pass(string: str) -> None:
    assert len(check_string(string, ALPHABET, CASTLE).types) == sum(character.isalpha() for character in string)


@pytest.mark.parametrize(
    ("string", "index", "reason"),
    [
        ("A0DADCD0", 5, r"D \(wall\) and C \(flag\) are never neighbours"),
        ("A0DAADAD0", 4, r"A \(tower\) and A \(tower\) are never neighbours"),
        ("D0ADAB0", 5, r"A \(tower\) and B \(gate\) are never neighbours"),
        ("A0(C)(C)DADAD0", 0, "A was never seen with 2 C, 2 D around it"),
        ("ADADA", 0, "A was never seen with 1 D around it"),
        ("A", 0, "A was never seen with no neighbour around it"),
        ("A0DADBDBD0", 6, "D was never seen with 2 B around it"),
    ],
)
def test_errors_name_the_first_violation(string: str, index: int, reason: str) -> None:
    with pytest.raises(StringError, match=reason) as caught:
        check_string(string, ALPHABET, CASTLE)
    assert caught.value.index == index


def test_errors_name_forbidden_cycle_edges_at_the_number() -> None:
    with pytest.raises(StringError, match="never neighbours") as caught:
        check_string("A0DAD(A0)D", ALPHABET, CASTLE)
    assert caught.value.index == 1


def test_unreadable_strings_are_rejected() -> None:
    with pytest.raises(StringError, match="not closed"):
        check_string("A(D", ALPHABET, CASTLE)


@pytest.mark.parametrize("edges", ["faces", "tree"])
def test_parts_may_have_fewer_neighbors_in_strings_that_omit_contacts(edges: Edges) -> None:
    for string in ("ADADAD", "CADADBDAD", "D(AD)AC"):
        with pytest.raises(StringError):
            check_string(string, ALPHABET, CASTLE)
        check_string(string, ALPHABET, CASTLE, edges)
    for string, index in (("ADADCD", 4), ("A(C)(C)DAD", 0), ("AD(A)AD", 1)):
        with pytest.raises(StringError) as caught:
            check_string(string, ALPHABET, CASTLE, edges)
        assert caught.value.index == index
