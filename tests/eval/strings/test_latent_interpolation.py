"""Latent interpolation, on small rings."""

from __future__ import annotations

import numpy as np
import pytest

from eval.strings.latent_interpolation import interpolation_rows, interpolations
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.graphs.canonical import graph_digest
from stages.string_sampling.instantiation.instantiate import Instantiator
from stages.string_sampling.instantiation.state import STANDARD_METHOD
from stages.strings.compiled_grammar import compile_grammar, patterns_json
from stages.strings.decoder import decode
from stages.strings.kit_strings import KitStrings
from stages.strings.tokens import make_alphabet
from stages.training.string_vae.settings import StringVaeConfig
from stages.training.string_vae.trained import TrainedStringVae
from stages.training.string_vae.training import new_model
from stages.training.string_vae.vocabulary import Vocabulary
from tests.toy_kits.chains_and_rings import ROAD, kit_of, ring

MAX_TOKENS = 40


@pytest.fixture(scope="module")
def instantiator() -> Instantiator:
    return Instantiator(ContactOracle(kit_of(ROAD, [ring(1, 1), ring(2, 3)])))


@pytest.fixture(scope="module")
def strings(instantiator: Instantiator) -> list[str]:
    writer, rng = KitStrings(instantiator.kit, "all"), np.random.default_rng(0)
    graphs = [writer.graph(exemplar.assembly) for exemplar in instantiator.kit.exemplars]
    return [encoded.string for graph in graphs for encoded in writer.strings(graph, 2, rng)]


@pytest.fixture(scope="module")
def model(instantiator: Instantiator) -> TrainedStringVae:
    vocabulary = Vocabulary(make_alphabet(instantiator.kit.labels), 2)
    grammar = compile_grammar(instantiator.kit.grammar, len(instantiator.kit.labels), 2)
    settings = StringVaeConfig(name="tiny", latent=4, embedding=4, hidden=16)
    header = {
        "settings": settings.model_dump(mode="json", exclude={"name", "kits", "seeds", "patience"}),
        "max_tokens": MAX_TOKENS,
        "patterns": patterns_json(grammar),
        "names": list(instantiator.kit.labels),
        "cycles": 2,
        "canonical": True,
    }
    return TrainedStringVae(new_model(settings, vocabulary, MAX_TOKENS, 0).eval(), vocabulary, grammar, header)


def digest(model: TrainedStringVae, string: str) -> str:
    graph = decode(string, model.vocabulary.alphabet)
    return graph_digest(graph.types, graph.edges)


def test_interpolations_join_different_training_shapes(model: TrainedStringVae, strings: list[str]) -> None:
    by_name = interpolations(model, strings, np.random.default_rng(1))
    assert len(by_name) == 3
    for along in by_name.values():
        assert {along[0], along[-1]} <= set(strings)
        assert digest(model, along[0]) != digest(model, along[-1])
    assert set(by_name["through the search graph"]) <= set(strings)


def test_interpolation_rows_skip_repeats_and_count_failures(
    model: TrainedStringVae, strings: list[str], instantiator: Instantiator
) -> None:
    image_rows = list(
        interpolation_rows(model, strings, instantiator, STANDARD_METHOD, "tiny", np.random.default_rng(1))
    )
    through = image_rows[-1]
    assert len(through.pictures) == 2
    assert "become no shape" not in through.title
    assert all(png.startswith(b"\x89PNG") for row in image_rows for _, png in row.pictures)
    nothing = list(
        interpolation_rows(
            model, strings, instantiator, STANDARD_METHOD._replace(budget=1), "tiny", np.random.default_rng(1)
        )
    )
    assert not nothing[-1].pictures
    assert "2 of 2 stops become no shape" in nothing[-1].title
