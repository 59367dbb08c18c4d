"""Bounds of the graph edit distance: exact where few edits are made, and around the truth on small graphs."""

from __future__ import annotations

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stages.shape.kit import Assembly
from stages.variations.novelty.edit_distance import edit_bounds


def graph(types: list[int], edges: list[tuple[int, int]]) -> Assembly:
    listed = np.array(sorted(edges), dtype=np.int32).reshape(-1, 2)
    return Assembly(np.array(types, dtype=np.int16), np.tile(np.eye(4), (len(types), 1, 1)), listed)


RING = graph([0, 1, 0, 1], [(0, 1), (1, 2), (2, 3), (0, 3)])


@pytest.mark.parametrize(
    ("other", "edits"),
    [
        (RING, 0),
        (graph([0, 1, 0, 2], [(0, 1), (1, 2), (2, 3), (0, 3)]), 1),
        (graph([0, 1, 0, 1], [(0, 1), (1, 2), (2, 3)]), 1),
        (graph([0, 1, 0], [(0, 1), (1, 2)]), 3),
    ],
)
def test_bounds_are_exact_for_few_edits(other: Assembly, edits: int) -> None:
    assert edit_bounds(RING, other) == edit_bounds(other, RING) == (edits, edits)


def test_bounds_do_not_depend_on_the_order_of_parts() -> None:
    turned = graph([1, 0, 1, 0], [(0, 1), (1, 2), (2, 3), (0, 3)])
    low, high = edit_bounds(RING, turned)
    assert low == 0 <= high


@st.composite
def graphs(draw: st.DrawFn) -> Assembly:
    types = draw(st.lists(st.integers(0, 2), min_size=1, max_size=4))
    pairs = [(i, j) for j in range(len(types)) for i in range(j)]
    return graph(types, draw(st.lists(st.sampled_from(pairs), unique=True)) if pairs else [])


def drawn(assembly: Assembly) -> nx.Graph:
    made = nx.Graph()
    made.add_nodes_from((part, {"type": part_type}) for part, part_type in enumerate(assembly.types.tolist()))
    made.add_edges_from(assembly.edges.tolist())
    return made


@settings(deadline=None, max_examples=60)
@given(graphs(), graphs())
def test_distance_is_between_the_bounds(first: Assembly, second: Assembly) -> None:
    low, high = edit_bounds(first, second)
    truth = nx.graph_edit_distance(drawn(first), drawn(second), node_match=lambda a, b: a["type"] == b["type"])
    assert low <= truth <= high
