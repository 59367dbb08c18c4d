"""Ways through a latent space, on rings that are known by heart."""

from __future__ import annotations

import numpy as np
import pytest

from eval.strings.latent_interpolation import journey_strips, journeys
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.graphs.canonical import graph_digest
from stages.string_sampling.instantiation.instantiate import Instantiator
from stages.string_sampling.instantiation.state import STANDARD_METHOD
from stages.strings.alphabet import make_alphabet
from stages.strings.compiled_grammar import compile_grammar, patterns_json
from stages.strings.decoder import decode
from stages.strings.kit_strings import KitStrings
from stages.training.string_vae.settings import StringVaeConfig
from stages.training.string_vae.trained import TrainedStringVae
from stages.training.string_vae.training import new_model
from stages.training.string_vae.vocabulary import Vocabulary
from tests.toy_kits.chains_and_rings import ROAD, kit_of, ring

MOST = 40


@pytest.fixture(scope="module")
def maker() -> Instantiator:
    return Instantiator(ContactOracle(kit_of(ROAD, [ring(1, 1), ring(2, 3)])))


@pytest.fixture(scope="module")
def strings(maker: Instantiator) -> list[str]:
    writer, rng = KitStrings(maker.kit, "all"), np.random.default_rng(0)
    graphs = [writer.graph(each.assembly) for each in maker.kit.exemplars]
    return [each.string for graph in graphs for each in writer.strings(graph, 2, rng)]


@pytest.fixture(scope="module")
def model(maker: Instantiator) -> TrainedStringVae:
    vocabulary = Vocabulary(make_alphabet(maker.kit.labels), 2)
    rules = compile_grammar(maker.kit.grammar, len(maker.kit.labels), 2)
    settings = StringVaeConfig(name="tiny", latent=4, embedding=4, hidden=16)
    header = {
        "settings": settings.model_dump(mode="json", exclude={"name", "kits", "seeds", "patience"}),
        "max_tokens": MOST,
        "patterns": patterns_json(rules),
        "names": list(maker.kit.labels),
        "cycles": 2,
        "canonical": True,
    }
    return TrainedStringVae(new_model(settings, vocabulary, MOST, 0).eval(), vocabulary, rules, header)


def digest(model: TrainedStringVae, string: str) -> str:
    graph = decode(string, model.vocabulary.alphabet)
    return graph_digest(graph.types, graph.edges)


def test_all_ways_lead_from_one_shape_to_the_one_that_is_least_alike(
    model: TrainedStringVae, strings: list[str]
) -> None:
    ways = journeys(model, strings, np.random.default_rng(1))
    assert len(ways) == 3
    for along in ways.values():
        assert {along[0], along[-1]} <= set(strings)
        assert digest(model, along[0]) != digest(model, along[-1])
    assert set(ways["through the search graph"]) <= set(strings)


def test_what_stands_side_by_side_differs_and_what_fails_is_told(
    model: TrainedStringVae, strings: list[str], maker: Instantiator
) -> None:
    strips = list(journey_strips(model, strings, maker, STANDARD_METHOD, "tiny", np.random.default_rng(1)))
    through = strips[-1]
    assert len(through.pictures) == 2
    assert "become no shape" not in through.title
    assert all(png.startswith(b"\x89PNG") for each in strips for _, png in each.pictures)
    nothing = list(
        journey_strips(model, strings, maker, STANDARD_METHOD._replace(budget=1), "tiny", np.random.default_rng(1))
    )
    assert not nothing[-1].pictures
    assert "2 of 2 stops become no shape" in nothing[-1].title
