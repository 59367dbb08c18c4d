"""What the table of instantiation counts, on rings that are known by heart."""

from __future__ import annotations

import numpy as np
import pytest

from eval.generated.instantiation import METHODS, Attempt, attempts, distinct_graphs, methods_table, outcome_table
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.graphs.canonical import graph_digest
from stages.shape.kit import Assembly
from stages.string_sampling.instantiation.guidance import guide_of
from stages.string_sampling.instantiation.instantiate import Instantiator
from stages.string_sampling.instantiation.state import STANDARD_METHOD
from stages.strings.alphabet import make_alphabet
from stages.strings.categories import CategorySpace
from stages.strings.decoder import decode
from stages.strings.kit_strings import KitStrings
from tests.toy_kits.chains_and_rings import ROAD, kit_of, ring


@pytest.fixture(scope="module")
def maker() -> Instantiator:
    return Instantiator(ContactOracle(kit_of(ROAD, [ring(1, 1), ring(2, 3)])))


def strings(maker: Instantiator) -> list[str]:
    """Three strings of each exemplar."""
    writer, rng = KitStrings(maker.kit, "all"), np.random.default_rng(0)
    graphs = [writer.graph(each.assembly) for each in maker.kit.exemplars]
    return [each.string for graph in graphs for each in writer.strings(graph, 2, rng)]


def test_each_graph_counts_once_and_known_ones_not_at_all(maker: Instantiator) -> None:
    alphabet = make_alphabet(maker.kit.labels)
    found = distinct_graphs(strings(maker), alphabet, 10)
    assert len(found) == 2
    assert len(distinct_graphs(strings(maker), alphabet, 1)) == 1
    known = {graph_digest(found[0].types, found[0].edges)}
    assert [len(each.types) for each in distinct_graphs(strings(maker), alphabet, 10, known)] == [len(found[1].types)]


def test_every_method_but_chance_puts_small_rings_together(maker: Instantiator) -> None:
    graphs = distinct_graphs(strings(maker)[:1], make_alphabet(maker.kit.labels), 1)
    for name, method in METHODS.items():
        made = attempts(maker, graphs, method._replace(budget=20_000), 3)
        assert all(each.good for each in made) or "random dockings" in name, name
        assert [each.rank for each in made] == [1]


def test_with_true_categories_nothing_is_searched(maker: Instantiator) -> None:
    space, writer = CategorySpace(maker.kit), KitStrings(maker.kit, "all")
    for exemplar in maker.kit.exemplars:
        for encoded in writer.strings(writer.graph(exemplar.assembly), 3, np.random.default_rng(1)):
            labelled = space.label(exemplar.assembly, [encoded])[0]
            scores = np.full((len(labelled.categories), len(space)), -np.inf)
            scores[np.arange(len(scores)), labelled.categories] = 0.0
            decoded = decode(labelled.string, space.alphabet)
            found = attempts(maker, [decoded], STANDARD_METHOD, 5, [guide_of(space, decoded, scores)])
            assert found[0].good
            assert found[0].tries == len(decoded.types)


def test_shares_are_of_graphs_and_a_faulty_shape_is_none() -> None:
    rows = [
        Attempt(10, 0, None, "no arrangement", 0, 30, 0.1),
        Attempt(40, 2, _some(), "", 0, 40, 0.3),
        Attempt(70, 2, _some(), "", 1, 70, 0.2),
    ]
    cells = dict(zip(outcome_table([]).columns, outcome_table([("of a kit", rows)]).rows[0], strict=True))
    assert cells["shapes %"] == pytest.approx(100 / 3)
    assert (cells["trees %"], cells["1-2 cycles %"], cells["3-5 %"]) == (0.0, 50.0, "")
    assert (cells["to 30 parts %"], cells["31-60 %"], cells["61+ %"]) == (0.0, 100.0, 0.0)
    assert cells["impossible %"] == pytest.approx(100 / 3)
    assert cells["faulty"] == 1
    assert cells["tries a part"] == pytest.approx((3 + 1 + 1) / 3)
    table = methods_table([("kit", "all steps", rows)])
    assert "fig. 8" in table.markdown()


def _some() -> Assembly:
    return kit_of(ROAD, [ring(1, 1)]).exemplars[0].assembly
