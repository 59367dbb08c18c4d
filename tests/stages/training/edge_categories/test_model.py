"""Models of edge categories: what they see, what they learn, and how strings vote."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from stages.exemplars.build import read_kit
from stages.exemplars.settings import STRICTEST, KitConfig, ShapeFile
from stages.shape.geometry.pose import pose_vectors
from stages.strings.categories import CategorySpace, token_edges
from stages.strings.decoder import decode
from stages.strings.encoder import Encoded
from stages.strings.kit_strings import KitStrings
from stages.strings.tokens import split_tokens
from stages.training.checkpoint import CheckpointError, checkpoint_bytes
from stages.training.edge_categories.batches import PAD_CODE, CategoryTables, batch_of, batches, read_string
from stages.training.edge_categories.model import AutoregressiveEdgeDecoder
from stages.training.edge_categories.settings import EdgeCategoriesConfig
from stages.training.edge_categories.trained import TrainedEdgeCategories, load_edge_categories
from stages.training.edge_categories.training import new_model
from tests.stages.training.edge_categories.networks import (
    MAX_CYCLE_NUMBERS,
    kit,
    labelled,
    learner,
    network,
    random_model,
    space,
    strings_of,
    trained_model,
    writer,
)
from tests.toy_kits.program_chairs import write_chairs

DECODERS = ("lstm", "autoregressive")


def strings(seed: int, count: int = 0) -> list[Encoded]:
    return writer().strings(writer().graph(network(seed)), count, np.random.default_rng(seed))


def right(seed: int) -> np.ndarray:
    """The categories of the canonical string of a network."""
    (found,) = space().label(network(seed), strings(seed), either_hand=True)
    return found.categories


def test_string_is_read_with_the_parts_at_both_ends_of_edges() -> None:
    rows = read_string("A0B(C)BA0", space().alphabet, MAX_CYCLE_NUMBERS)
    sign, bracket, cycle = 3, 4, 6
    assert rows[:, 0].tolist() == [1, cycle, 2, bracket, sign, bracket + 1, 2, 1, cycle]
    assert rows[:, 1].tolist() == [-1, 0, 0, -1, 2, -1, 2, 6, 7]
    assert rows[:, 2].tolist() == [0, 7, 2, -1, 4, -1, 6, 7, 0]
    many = read_string("A%17BAB%17", space().alphabet, MAX_CYCLE_NUMBERS)
    assert many[1, 0] == many[5, 0] == cycle + MAX_CYCLE_NUMBERS - 1, "numbers that are not told apart are the last"


def test_batch_has_the_mask_of_every_token_by_the_labels_of_its_edge() -> None:
    rows = [labelled(network(seed), 0, 0)[0] for seed in (1, 2)]
    batch = batch_of(rows, space().masks)
    for place, seed in enumerate((1, 2)):
        (encoded,) = strings(seed)
        count = len(rows[place])
        assert np.array_equal(batch.allowed[place, :count].numpy(), space().allowed(encoded.string))
        assert batch.categories[place, :count].tolist() == right(seed).tolist()
        assert (batch.codes[place, count:] == PAD_CODE).all()
        assert batch.is_token[place].sum() == count == len(split_tokens(encoded.string))


def test_batches_hold_every_string_once_in_random_order() -> None:
    made = strings_of(6)
    for rng in (None, np.random.default_rng(0)):
        seen = [batch.lengths.tolist() for batch in batches(made, 4, space().masks, rng)]
        assert sorted(length for item in seen for length in item) == sorted(made.lengths.tolist())
        assert max(map(len, seen)) <= 4


@pytest.mark.parametrize("decoder", DECODERS)
def test_logits_of_a_string_do_not_depend_on_the_rest_of_the_batch(decoder: str) -> None:
    module = random_model(decoder=decoder).module
    rows = sorted((labelled(network(seed, size), 0, 0)[0] for seed, size in ((1, 2), (2, 5))), key=len)
    with torch.no_grad():
        alone, beside = (module(batch_of(value, space().masks))[0, : len(rows[0])] for value in (rows[:1], rows))
    torch.testing.assert_close(alone, beside, rtol=1e-4, atol=1e-4)


def test_autoregressive_decoder_depends_on_earlier_categories_only() -> None:
    module = random_model(decoder="autoregressive").module
    batch = batch_of([labelled(network(3), 0, 0)[0]], space().masks)
    token = next(number for number in range(4, batch.codes.shape[1]) if int(batch.allowed[0, number].sum()) > 1)
    with torch.no_grad():
        before = module(batch)[0]
        allowed = batch.allowed[0, token].nonzero()[:, 0].tolist()
        batch.categories[0, token] = next(item for item in allowed if item != int(batch.categories[0, token]))
        after = module(batch)[0]
    torch.testing.assert_close(before[: token + 1], after[: token + 1])
    assert not torch.allclose(before[token + 1], after[token + 1])


def test_frames_of_the_autoregressive_decoder_match_the_placed_parts() -> None:
    module = random_model(decoder="autoregressive").module
    assert isinstance(module, AutoregressiveEdgeDecoder)
    (encoded,) = strings(4)
    row = labelled(network(4), 0, 0)[0]
    frames = module.frames(batch_of([row], space().masks))[0].double().numpy()
    frames[:, :3, 3] *= np.mean([item.diagonal for item in kit().types])
    placed = space().place(encoded.string, row[:, 3])
    parts = [token for token, text in enumerate(split_tokens(encoded.string)) if text in space().alphabet.types]
    np.testing.assert_allclose(pose_vectors(frames[parts], 1.0), pose_vectors(placed.poses, 1.0), atol=1e-4)


@pytest.mark.parametrize("decoder", DECODERS)
def test_stepwise_scores_match_those_of_whole_strings(decoder: str) -> None:
    model = random_model(decoder=decoder)
    (encoded,) = strings(5)
    steps = model.decoding([encoded.string, "A", encoded.string])
    for category in right(5).tolist():
        steps.scores()
        steps.take(np.array([category, category if steps.token == 0 else 0, category]))
    assert steps.categories()[0].tolist() == steps.categories()[2].tolist() == right(5).tolist()
    (whole,) = model.log_probabilities([encoded.string], [right(5)])
    again = model.decoding([encoded.string])
    for token, category in enumerate(right(5).tolist()):
        np.testing.assert_allclose(again.scores()[0], whole[token], rtol=1e-3, atol=1e-3)
        again.take(np.array([category]))


def test_kept_rows_continue_unchanged() -> None:
    model = random_model(decoder="autoregressive")
    texts = [strings(seed)[0].string for seed in (1, 2)]
    both, kept = model.decoding(texts), model.decoding(texts)
    for value in (both, kept):
        for _ in range(3):
            value.take(value.scores().argmax(axis=1))
    kept.keep(np.array([1, 1]))
    np.testing.assert_allclose(kept.scores(), both.scores()[[1, 1]], atol=1e-5)


@pytest.mark.parametrize("decoder", DECODERS)
def test_chosen_categories_are_allowed_by_the_mask(decoder: str) -> None:
    model = random_model(decoder=decoder)
    for seed in range(3):
        (encoded,) = strings(seed)
        for rng in (None, np.random.default_rng(seed)):
            (chosen,) = model.choose([encoded.string], rng)
            space().place(encoded.string, chosen)
        scores = model.scores(encoded.string)
        assert ((scores > -np.inf) <= space().allowed(encoded.string)).all()
        np.testing.assert_allclose(np.exp(scores).sum(axis=1), 1.0)
    without = random_model(decoder=decoder, mask=False)
    assert (without.scores(strings(0)[0].string) > -np.inf).all()


@pytest.mark.slow
def test_sampled_categories_keep_the_type_of_every_part(tmp_path: Path) -> None:
    """Labels do not determine the type of a part; its first category does, for all its neighbours."""
    shapes = tuple(ShapeFile(path=path) for path in write_chairs(tmp_path, 4))
    chairs = read_kit(KitConfig(name="chairs", shapes=shapes, types="meaning").resolve(STRICTEST))
    of_chairs, of_kit = CategorySpace(chairs), KitStrings(chairs, "all")
    settings = model_entry(random_model(decoder="autoregressive"))
    module = new_model(settings, CategoryTables.of(of_chairs), MAX_CYCLE_NUMBERS, 0)
    model = TrainedEdgeCategories(module.eval(), of_chairs, random_model().header)
    for seed, exemplar in enumerate(chairs.exemplars):
        texts = [
            string.string for string in of_kit.strings(of_kit.graph(exemplar.assembly), 2, np.random.default_rng(seed))
        ]
        for string, chosen in zip(texts, model.choose(texts, np.random.default_rng(seed)), strict=True):
            decoded = decode(string, of_chairs.alphabet)
            types: dict[int, int] = {}
            for text, (here, there), item in zip(decoded.texts, token_edges(decoded).tolist(), chosen, strict=True):
                if text in of_chairs.alphabet.types:
                    beside = of_chairs.categories_between(types.get(here), int(decoded.types[there]))
                    assert item in beside or not beside
                    types[there] = int(of_chairs.types[item, 1])


def model_entry(model: TrainedEdgeCategories) -> EdgeCategoriesConfig:
    return EdgeCategoriesConfig.model_validate({"name": "tiny", **model.header["settings"]})


@pytest.mark.slow
def test_both_decoders_learn_and_the_autoregressive_one_learns_more() -> None:
    """Where the first of several rods goes is anybody's guess, but those after it must go elsewhere."""
    found = {}
    for decoder in DECODERS:
        model = trained_model(decoder=decoder)
        learning = learner(model_entry(model))
        with torch.no_grad():
            fresh = learning.validate(torch.Generator())
            learning.module.load_state_dict(model.module.state_dict())
            found[decoder] = learning.validate(torch.Generator())
        assert found[decoder]["loss"] < fresh["loss"] / 2
        assert found[decoder]["tokens"] >= found[decoder]["accuracy"] > fresh["accuracy"]
    assert found["autoregressive"]["accuracy"] > found["lstm"]["accuracy"]
    assert found["autoregressive"]["strings"] > found["lstm"]["strings"]


@pytest.mark.slow
def test_strings_vote_for_a_closed_shape_that_all_describe() -> None:
    model = trained_model(decoder="autoregressive")
    several = strings(1, 4)
    # as seen from the first: its nodes are those of its own order
    order = np.argsort(several[0].nodes)
    others = [Encoded(item.string, order[item.nodes]) for item in several[1:]]
    results = model.vote(several)
    likely = [result.log_probability for result in results]
    assert likely
    assert likely == sorted(likely, reverse=True)
    spans = []
    for encoded, categories in zip(several, results[0].categories, strict=True):
        places = space().place(encoded.string, categories).poses[:, :3, 3]
        spans.append(np.sort(np.linalg.norm(places[:, None] - places, axis=2), axis=None))
    np.testing.assert_allclose(np.array(spans[1:]), np.tile(spans[0], (len(spans) - 1, 1)), atol=1e-6)
    scores = model.scores(several[0].string, others)
    np.testing.assert_allclose(np.exp(scores).sum(axis=1), 1.0)


@pytest.mark.parametrize("decoder", DECODERS)
def test_weights_are_read_for_their_own_kit_only(decoder: str, tmp_path: Path) -> None:
    model = random_model(decoder=decoder)
    path = tmp_path / "weights.safetensors"
    path.write_bytes(checkpoint_bytes(model.module.state_dict(), model.header))
    (encoded,) = strings(0)
    again = load_edge_categories(path, kit())
    np.testing.assert_array_equal(again.scores(encoded.string), model.scores(encoded.string))
    for changes, said in (({"kit": "castle"}, "kit"), ({"places": []}, "places"), ({"kind": "string_vae"}, "kind")):
        path.write_bytes(checkpoint_bytes(model.module.state_dict(), {**model.header, **changes}))
        with pytest.raises(CheckpointError, match=f"another {said}"):
            load_edge_categories(path, kit())


def test_strings_of_different_spanning_trees_vote_for_the_shape_with_all_their_contacts() -> None:
    ring = next(number for number in map(network, range(50)) if len(number.edges) == len(number))
    trees = KitStrings(kit(), "tree")
    strings = trees.strings(trees.graph(ring), 5, np.random.default_rng(0))
    truth = [label.categories for label in space().label(ring, strings, either_hand=True)]
    model = random_model(decoder="autoregressive")
    (result,) = model.vote(strings, truth)
    for read, wanted in zip(result.categories, truth, strict=True):
        np.testing.assert_array_equal(read, wanted)
