"""The tables of instantiation, on small rings."""

from __future__ import annotations

import numpy as np
import pytest

from eval.generated.instantiation import (
    METHODS,
    InstantiationAttempt,
    attempts,
    distinct_graphs,
    methods_table,
    outcome_table,
)
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.graphs.canonical import graph_digest
from stages.shape.kit import Assembly
from stages.string_sampling.instantiation.guidance import guide_of
from stages.string_sampling.instantiation.instantiate import Instantiator
from stages.string_sampling.instantiation.state import STANDARD_METHOD
from stages.strings.categories import CategorySpace
from stages.strings.decoder import decode
from stages.strings.kit_strings import KitStrings
from stages.strings.tokens import make_alphabet
from tests.toy_kits.chains_and_rings import ROAD, kit_of, ring


@pytest.fixture(scope="module")
def instantiator() -> Instantiator:
    return Instantiator(ContactOracle(kit_of(ROAD, [ring(1, 1), ring(2, 3)])))


def strings(instantiator: Instantiator) -> list[str]:
    """Return three strings of each exemplar."""
    writer, rng = KitStrings(instantiator.kit, "all"), np.random.default_rng(0)
    graphs = [writer.graph(exemplar.assembly) for exemplar in instantiator.kit.exemplars]
    return [encoded.string for graph in graphs for encoded in writer.strings(graph, 2, rng)]


def test_distinct_graphs_skip_repeats_and_known_graphs(instantiator: Instantiator) -> None:
    alphabet = make_alphabet(instantiator.kit.labels)
    found = distinct_graphs(strings(instantiator), alphabet, 10)
    assert len(found) == 2
    assert len(distinct_graphs(strings(instantiator), alphabet, 1)) == 1
    known = {graph_digest(found[0].types, found[0].edges)}
    assert [len(graph.types) for graph in distinct_graphs(strings(instantiator), alphabet, 10, known)] == [
        len(found[1].types)
    ]


def test_every_method_but_chance_instantiates_small_rings(instantiator: Instantiator) -> None:
    graphs = distinct_graphs(strings(instantiator)[:1], make_alphabet(instantiator.kit.labels), 1)
    for name, method in METHODS.items():
        tried = attempts(instantiator, graphs, method._replace(budget=20_000), 3)
        assert all(attempt.is_valid for attempt in tried) or "random dockings" in name, name
        assert [attempt.rank for attempt in tried] == [1]


def test_true_categories_need_no_search(instantiator: Instantiator) -> None:
    space, writer = CategorySpace(instantiator.kit), KitStrings(instantiator.kit, "all")
    for exemplar in instantiator.kit.exemplars:
        for encoded in writer.strings(writer.graph(exemplar.assembly), 3, np.random.default_rng(1)):
            labelled = space.label(exemplar.assembly, [encoded])[0]
            scores = np.full((len(labelled.categories), len(space)), -np.inf)
            scores[np.arange(len(scores)), labelled.categories] = 0.0
            decoded = decode(labelled.string, space.alphabet)
            found = attempts(instantiator, [decoded], STANDARD_METHOD, 5, [guide_of(space, decoded, scores)])
            assert found[0].is_valid
            assert found[0].placements == len(decoded.types)


def test_shares_count_graphs_and_exclude_faulty_shapes() -> None:
    rows = [
        InstantiationAttempt(10, 0, None, "no arrangement", 0, 30, 0.1),
        InstantiationAttempt(40, 2, _some(), "", 0, 40, 0.3),
        InstantiationAttempt(70, 2, _some(), "", 1, 70, 0.2),
    ]
    cells = dict(zip(outcome_table([]).columns, outcome_table([("of a kit", rows)]).rows[0], strict=True))
    assert cells["shapes %"] == pytest.approx(100 / 3)
    assert (cells["trees %"], cells["1-2 cycles %"], cells["3-5 %"]) == (0.0, 50.0, "")
    assert (cells["to 30 parts %"], cells["31-60 %"], cells["61+ %"]) == (0.0, 100.0, 0.0)
    assert cells["impossible %"] == pytest.approx(100 / 3)
    assert cells["faulty"] == 1
    assert cells["placements a part"] == pytest.approx((3 + 1 + 1) / 3)
    table = methods_table([("kit", "all steps", rows)])
    assert "fig. 8" in table.markdown()


def _some() -> Assembly:
    return kit_of(ROAD, [ring(1, 1)]).exemplars[0].assembly
