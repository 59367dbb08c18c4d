"""Which neighbourhoods a grammar admits: by hand, by brute force, and one level within the next."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations_with_replacement

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stages.shape.graphs.neighbourhoods import STRICTNESS, admits
from stages.shape.kit import Grammar, Multiset, Strictness
from tests.stages.strings.grammar_check import admits_superset

A, B, C, D = range(4)


def multiset(*types: int) -> Multiset:
    return tuple((kind, types.count(kind)) for kind in sorted(set(types)))


def grammar(*observed: Multiset, strictness: Strictness = "multiset", hubs: tuple[int, ...] = ()) -> Grammar:
    return Grammar({A: dict.fromkeys(observed, 1)}, (), {}, strictness, hubs)


def every(most: int, types: int = 4) -> list[Multiset]:
    """Return every neighbourhood of at most `most` parts of `types` types."""
    return [multiset(*kinds) for size in range(most + 1) for kinds in combinations_with_replacement(range(types), size)]


def language(rules: Grammar, most: int = 5) -> set[Multiset]:
    return {neighbours for neighbours in every(most) if admits(rules, A, neighbours)}


SEEN = (multiset(B, B, C), multiset(C, D))


@pytest.mark.parametrize(
    ("strictness", "extra"),
    [
        ("multiset", []),
        ("count_and_set", [multiset(B, C, C)]),
        (
            "count_and_pairs",
            [
                *(multiset(B, C, C), multiset(C, C, D), multiset(C, D, D)),
                *(multiset(kind, kind, kind) for kind in (B, C, D)),
                *(multiset(B, C), multiset(B, B), multiset(C, C), multiset(D, D)),
            ],
        ),
        (
            "count_and_types",
            [multiset(*kinds) for size in (2, 3) for kinds in combinations_with_replacement((B, C, D), size)],
        ),
    ],
)
def test_levels_admit_observed_and_specified_neighbourhoods(strictness: Strictness, extra: list[Multiset]) -> None:
    assert language(grammar(*SEEN, strictness=strictness)) == {*SEEN, *extra}


def test_a_type_never_seen_around_and_a_part_without_neighbours_are_refused_on_every_level() -> None:
    for strictness in STRICTNESS:
        rules = grammar(*SEEN, strictness=strictness)
        assert not admits(rules, A, multiset(A, B, C))
        assert not admits(rules, A, ())
        assert not admits(rules, B, multiset(A))
    assert all(admits(grammar((), strictness=level), A, ()) for level in STRICTNESS)


observations = st.sets(
    st.lists(st.integers(0, 3), max_size=5).map(lambda kinds: multiset(*kinds)), min_size=1, max_size=5
)


@given(observations)
def test_levels_nest(observed: set[Multiset]) -> None:
    inner = set(observed)
    for strictness in STRICTNESS:
        rules = grammar(*sorted(observed), strictness=strictness)
        admitted = language(rules)
        assert inner <= admitted
        inner = admitted


def test_hubs_may_have_any_neighbours_and_do_not_count_as_neighbours() -> None:
    rules = replace(grammar(multiset(B, C), hubs=(D,)), neighbourhoods={A: {multiset(B, C): 1}, D: {multiset(A): 1}})
    assert admits(rules, A, multiset(B, C, D, D))
    assert not admits(rules, A, multiset(B, D))
    assert admits(rules, D, multiset(A, A, B))


@given(observations, st.sampled_from(STRICTNESS))
def test_fewer_neighbours_are_admitted_exactly_where_some_neighbourhood_has_them(
    observed: set[Multiset], strictness: Strictness
) -> None:
    rules = grammar(*observed, strictness=strictness)
    wholes = [dict(neighbours) for neighbours in every(6) if admits(rules, A, neighbours)]
    for part in every(4):
        found = any(all(whole.get(other, 0) >= count for other, count in part) for whole in wholes)
        assert admits_superset(rules, A, part) == found


def test_hubs_are_left_out_of_account_where_neighbours_are_missing_too() -> None:
    rules = grammar(multiset(B, C), hubs=(D,))
    assert admits_superset(rules, A, multiset(B, D, D))
    assert not admits_superset(rules, A, multiset(B, B, D))
    assert admits_superset(rules, D, multiset(A, A, B))
