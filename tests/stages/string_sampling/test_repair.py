"""Strings that no shape has are told by their first wrong token, and written anew from there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stages.shape.geometry.contact_oracle import ContactOracle
from stages.string_sampling.instantiation.instantiate import Instantiator
from stages.string_sampling.instantiation.state import STANDARD_METHOD
from stages.string_sampling.repair import first_impossible_token, repair_strings
from stages.strings.alphabet import make_alphabet
from stages.strings.decoder import decode
from stages.training.string_vae.latent_sampling import LatentSearchResult, sample
from stages.training.string_vae.trained import TrainedStringVae, load_string_vae
from tests.stages.string_sampling.trained_model import publish_model
from tests.toy_kits.chains_and_rings import ROAD, kit_of, ring

LOOSE = STANDARD_METHOD._replace(whole=False)


@pytest.fixture(scope="module")
def roads() -> Instantiator:
    return Instantiator(ContactOracle(kit_of(ROAD, [ring(1, 1), ring(2, 3)])))


@pytest.fixture
def model(roads: Instantiator, tmp_path: Path) -> TrainedStringVae:
    return load_string_vae(publish_model(tmp_path, "learnt", roads.kit, ["AA"]))


def place_of(roads: Instantiator, names: str) -> int | None:
    """first_impossible of a string of `c`orners and `s`traight tiles."""
    alphabet = make_alphabet(roads.kit.labels)
    tokens = {each[0]: token for each, token in zip(roads.kit.labels, alphabet.tokens, strict=True)}
    string = "".join(tokens.get(each, each) for each in names)
    return first_impossible_token(roads, decode(string, alphabet), LOOSE, 0)


@pytest.mark.parametrize(
    ("names", "place"),
    [
        ("c0scscscs0", None),
        ("c0scssscscsss0", None),
        ("cscscs", 5),  # has ends
        ("c", 0),  # stands alone
        ("c0scscs0", 7),  # a triangle
        ("c0scscscss0", 9),  # where it began
        ("c0scs0cs", 5),  # closes at once, and goes on
    ],
)
def test_the_first_token_that_no_arrangement_allows(roads: Instantiator, names: str, place: int | None) -> None:
    assert place_of(roads, names) == place


def test_what_goes_wrong_goes_on_otherwise_from_its_first_wrong_token(
    roads: Instantiator, model: TrainedStringVae
) -> None:
    found = sample(model, "prior", ["AA"], 12, np.random.default_rng(0), 1.0)
    drawn = [each.string or "" for each in found]
    places = [first_impossible_token(roads, decode(each, model.vocabulary.alphabet), LOOSE, 0) for each in drawn]
    assert sum(place is not None for place in places) > 6
    once = [each or "" for each in repair_strings(model, found, roads, LOOSE, 1, 0)]
    kept = 0
    for before, after, place in zip(drawn, once, places, strict=True):
        assert model.is_valid(after)
        assert (before == after) == (place is None)
        if place is not None:
            one, other = (model.vocabulary.codes(each).tolist() for each in (before, after))
            kept += one[:place] == other[:place] and one[place : place + 1] != other[place : place + 1]
    assert kept > 6  # others came to a dead end and went farther back
    assert repair_strings(model, found, roads, LOOSE, 1, 0) == once
    assert repair_strings(model, found, roads, LOOSE, 0, 0) == drawn
    assert repair_strings(model, [LatentSearchResult(None, 1, 0, found[0].point)], roads, LOOSE, 8, 0) == [None]
    lone = model.vocabulary.alphabet.tokens[0]
    (other,) = repair_strings(model, [LatentSearchResult(lone, 1, 1, found[0].point)], roads, LOOSE, 1, 0)
    assert other is not None
    assert not other.startswith(lone)
