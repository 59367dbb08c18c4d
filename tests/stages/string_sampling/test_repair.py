"""Impossible strings are repaired from their first impossible token."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stages.shape.geometry.contact_oracle import ContactOracle
from stages.string_sampling.instantiation.instantiate import Instantiator
from stages.string_sampling.instantiation.state import STANDARD_METHOD
from stages.string_sampling.repair import first_impossible_token, repair_strings
from stages.strings.decoder import decode
from stages.strings.tokens import make_alphabet
from stages.training.string_vae.latent_sampling import LatentSearchResult, sample
from stages.training.string_vae.trained import TrainedStringVae, load_string_vae
from tests.stages.string_sampling.trained_model import publish_model
from tests.toy_kits.chains_and_rings import ROAD, kit_of, ring

PARTIAL_CONTACTS = STANDARD_METHOD._replace(whole=False)


@pytest.fixture(scope="module")
def roads() -> Instantiator:
    return Instantiator(ContactOracle(kit_of(ROAD, [ring(1, 1), ring(2, 3)])))


@pytest.fixture
def model(roads: Instantiator, tmp_path: Path) -> TrainedStringVae:
    return load_string_vae(publish_model(tmp_path, "parent", roads.kit, ["AA"]))


def first_impossible(roads: Instantiator, names: str) -> int | None:
    """Return the first impossible token of a string of `c`orners and `s`traight tiles."""
    alphabet = make_alphabet(roads.kit.labels)
    tokens = {label[0]: token for label, token in zip(roads.kit.labels, alphabet.tokens, strict=True)}
    string = "".join(tokens.get(name, name) for name in names)
    return first_impossible_token(roads, decode(string, alphabet), PARTIAL_CONTACTS, 0)


@pytest.mark.parametrize(
    ("names", "index"),
    [
        ("c0scscscs0", None),
        ("c0scssscscsss0", None),
        ("cscscs", 5),  # has ends
        ("c", 0),  # has no neighbour
        ("c0scscs0", 7),  # a triangle
        ("c0scscscss0", 9),  # back at the start
        ("c0scs0cs", 5),  # closes at once, and continues
    ],
)
def test_first_impossible_token_is_found(roads: Instantiator, names: str, index: int | None) -> None:
    assert first_impossible(roads, names) == index


def test_repair_changes_a_string_from_its_first_impossible_token(roads: Instantiator, model: TrainedStringVae) -> None:
    found = sample(model, "prior", ["AA"], 12, np.random.default_rng(0), 1.0)
    sampled = [result.string or "" for result in found]
    indices = [
        first_impossible_token(roads, decode(string, model.vocabulary.alphabet), PARTIAL_CONTACTS, 0)
        for string in sampled
    ]
    assert sum(index is not None for index in indices) > 6
    once = [string or "" for string in repair_strings(model, found, roads, PARTIAL_CONTACTS, 1, 0)]
    kept = 0
    for before, after, index in zip(sampled, once, indices, strict=True):
        assert model.is_valid(after)
        assert (before == after) == (index is None)
        if index is not None:
            old, new = (model.vocabulary.codes(string).tolist() for string in (before, after))
            kept += old[:index] == new[:index] and old[index : index + 1] != new[index : index + 1]
    assert kept > 6  # others reached a dead end and were cut farther back
    assert repair_strings(model, found, roads, PARTIAL_CONTACTS, 1, 0) == once
    assert repair_strings(model, found, roads, PARTIAL_CONTACTS, 0, 0) == sampled
    assert repair_strings(model, [LatentSearchResult(None, 1, 0, found[0].point)], roads, PARTIAL_CONTACTS, 8, 0) == [
        None
    ]
    lone = model.vocabulary.alphabet.tokens[0]
    (other,) = repair_strings(model, [LatentSearchResult(lone, 1, 1, found[0].point)], roads, PARTIAL_CONTACTS, 1, 0)
    assert other is not None
    assert not other.startswith(lone)
