"""The string VAE: what it sees, what it learns, and what it writes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from stages.training.checkpoint import CheckpointError, checkpoint_bytes
from stages.training.loop import TrainState, train
from stages.training.string_vae.batches import batches, open_until
from stages.training.string_vae.model import shifted
from stages.training.string_vae.trained import load_string_vae
from stages.training.string_vae.training import StringVaeTask, annealed, new_model, triplet_loss
from stages.training.string_vae.vocabulary import END_TOKEN
from tests.stages.strings.grammar_check import check_string
from tests.stages.training import toy_training
from tests.stages.training.string_vae.models import (
    LEARNT_SHAPES,
    MAX_TOKENS,
    VOCABULARY,
    entry,
    numbered,
    random_vae,
    toy_strings,
    trained_vae,
)

DECODERS = ("plain", "masked", "transformer")


def until_of(codes: torch.Tensor) -> torch.Tensor:
    return torch.from_numpy(open_until(codes.numpy(), len(VOCABULARY) - VOCABULARY.cycles))


def test_a_cycle_is_open_from_its_number_to_the_same_number_again() -> None:
    codes = np.array([[1, 7, 2, 8, 7, 1, 7, 8, 7, 0], [8, 1, 1, 8, 1, 0, 0, 0, 0, 0], [1, 9, 0, 0, 0, 0, 0, 0, 0, 0]])
    wanted = np.zeros_like(codes)
    wanted[0, [1, 3, 6]] = [4, 7, 8]
    wanted[1, 0] = 3
    wanted[2, 1] = 9  # is never ended
    np.testing.assert_array_equal(open_until(codes, 7), wanted)
    np.testing.assert_array_equal(open_until(codes[:, :0], 7), wanted[:, :0])


def test_cycle_attention_changes_only_open_cycles() -> None:
    published = random_vae("plain", cycle_attention=True).module
    assert published.cycle_attention is None
    module = random_vae("masked", cycle_attention=True).module
    assert module.cycle_attention is not None
    codes, points = torch.tensor([[1, 7, 2, 6, 1, 6, 1, 7, 1]]), torch.zeros((1, 8))
    before = module.decode(shifted(codes), points, until_of(codes))
    plain, _ = module.decoder(shifted(codes), points)
    changed = (before != plain)[0]
    numbers = [[value in opened for value in (6, 7)] for opened in ((), (), (7,), (7,), (6, 7), (6, 7), (7,), (7,), ())]
    np.testing.assert_array_equal(changed[:, -2:].numpy(), numbers)
    assert not changed[:, :-2].any()


@pytest.mark.parametrize("cycle_attention", [False, True])
@pytest.mark.parametrize("decoder", DECODERS)
def test_stepwise_decoder_matches_whole_strings(decoder: str, cycle_attention: bool) -> None:
    module = random_vae(decoder, cycle_attention=cycle_attention).module
    rng = np.random.default_rng(1)
    codes = torch.from_numpy(rng.integers(0, len(VOCABULARY), (3, 11)))
    points = torch.from_numpy(rng.standard_normal((3, 8)).astype(np.float32))
    whole = module.decode(shifted(codes), points, until_of(codes))
    state = module.start(points)
    for place in range(11):
        logits, state = module.step(shifted(codes)[:, place], points, state)
        torch.testing.assert_close(logits, whole[:, place], rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("cycle_attention", [False, True])
@pytest.mark.parametrize("decoder", DECODERS)
def test_token_depends_only_on_earlier_tokens(decoder: str, cycle_attention: bool) -> None:
    module = random_vae(decoder, cycle_attention=cycle_attention).module
    codes = torch.ones((1, 9), dtype=torch.int64)
    codes[0, [1, 7]] = len(VOCABULARY) - 1
    changed = codes.clone()
    changed[0, 5] = 2
    points = torch.zeros((1, 8))
    before, after = (module.decode(shifted(value), points, until_of(value))[0] for value in (codes, changed))
    torch.testing.assert_close(before[:6], after[:6])
    assert not torch.allclose(before[6], after[6])


def test_encoding_of_a_string_does_not_depend_on_the_rest_of_the_batch() -> None:
    model, strings = random_vae("masked"), sorted(toy_strings(), key=len)
    alone, beside = model.encode(strings[:1]), model.encode([strings[0], strings[-1]])[:1]
    np.testing.assert_allclose(alone, beside, rtol=1e-4, atol=1e-5)
    assert not np.allclose(beside, model.encode(strings[-1:]))


@pytest.mark.parametrize("decoder", ["masked", "transformer"])
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("drawn", [True, False])
def test_masked_decoder_generates_strings_of_the_grammar(decoder: str, seed: int, drawn: bool) -> None:
    model, rng = random_vae(decoder, seed), np.random.default_rng(seed)
    points = (3 * rng.standard_normal((64, 8))).astype(np.float32)
    strings = model.decode(points, rng if drawn else None)
    for string in strings:
        check_string(string, toy_training.ALPHABET, toy_training.grammar())
        assert model.is_valid(string)
        assert len(VOCABULARY.codes(string)) <= MAX_TOKENS
    assert len(set(strings)) > 1


def test_string_with_too_many_dead_ends_is_finished_without_cycles() -> None:
    model = random_vae("masked")
    with torch.no_grad():  # cycle numbers wherever they may stand
        model.module.decoder.logits.bias[-2:] += 50.0
    strings = model.decode(np.random.default_rng(0).standard_normal((64, 8)).astype(np.float32), None)
    for string in strings:
        check_string(string, toy_training.ALPHABET, toy_training.grammar())
    assert any(string.count("0") or string.count("1") for string in strings)


def test_plain_decoder_generates_invalid_strings() -> None:
    model, rng = random_vae("plain"), np.random.default_rng(0)
    strings = model.decode(rng.standard_normal((64, 8)).astype(np.float32), rng)
    assert sum(map(model.is_valid, strings)) < 32


def test_equal_seeds_decode_equal_strings() -> None:
    model = random_vae("masked")
    points = np.random.default_rng(3).standard_normal((20, 8)).astype(np.float32)
    first, again, other = (model.decode(points, np.random.default_rng(seed)) for seed in (5, 5, 6))
    assert first == again
    assert first != other


@pytest.mark.slow
@pytest.mark.parametrize("decoder", DECODERS)
def test_trained_decoder_returns_canonical_strings(decoder: str) -> None:
    right, strings = {}, toy_strings(LEARNT_SHAPES)
    for name, model in (("trained", trained_vae(decoder)), ("random", random_vae(decoder))):
        pairs = zip(map(model.target_of, strings), model.decode(model.encode(strings), None), strict=True)
        right[name] = np.mean([one == other for one, other in pairs])
    assert right["random"] < 0.05
    assert right["trained"] > 0.5


def test_bfloat16_learns_nearly_the_same() -> None:
    losses = []
    for precision in ("float32", "bfloat16"):
        settings, strings = entry(precision=precision, steps=4), numbered()
        learner = StringVaeTask(
            new_model(settings, VOCABULARY, MAX_TOKENS, 1), {}, settings, strings, strings, VOCABULARY, True
        )
        learnt = train(TrainState.of(learner), np.random.default_rng(2), lambda done, total: None)
        losses.append(learnt["loss"])
    assert losses[0] != losses[1]
    assert losses[1] == pytest.approx(losses[0], rel=0.02)


@pytest.mark.parametrize("canonical", [False, True])
def test_batches_hold_every_string_once_with_its_target(canonical: bool) -> None:
    strings, seen = numbered(), []
    model = random_vae("masked")
    for batch in batches(strings, 16, len(VOCABULARY), canonical, np.random.default_rng(0)):
        rows = zip(batch.read, batch.read_lengths, batch.codes, batch.lengths, batch.allowed, strict=True)
        for read, read_length, codes, length, allowed in rows:
            text, written = VOCABULARY.string(read.tolist()), VOCABULARY.string(codes.tolist())
            seen.append(text)
            assert read[read_length - 1] == codes[length - 1] == END_TOKEN
            assert len(VOCABULARY.codes(text)) == read_length - 1
            assert len(VOCABULARY.codes(written)) == length - 1
            assert written == (model.target_of(text) if canonical else text)
            assert allowed.gather(-1, codes[:, None]).all()
            assert not allowed[:length].all(dim=-1).any()
    assert sorted(seen) == sorted(toy_strings())


def test_weight_of_the_divergence_rises_from_zero_to_one() -> None:
    weights = [annealed(step, 100) for step in range(0, 201, 10)]
    assert weights == sorted(weights)
    assert weights[0] < 0.005
    assert weights[5] == 0.5
    assert weights[10] > 0.995
    assert annealed(0, 0) == 1.0


def test_triplet_loss_is_small_if_similar_shapes_are_near() -> None:
    histograms = torch.tensor([[4.0, 0.0], [3.0, 1.0], [0.0, 4.0]])
    near = torch.tensor([[0.0], [0.1], [9.0]])
    far = torch.tensor([[0.0], [9.0], [0.1]])
    losses = [
        sum(float(triplet_loss(points, histograms, 1.0, torch.Generator().manual_seed(seed))) for seed in range(40))
        for points in (near, far)
    ]
    assert losses[0] < 0.1 * losses[1]


def test_published_weights_are_read_and_those_of_another_kit_refused(tmp_path: Path) -> None:
    model = random_vae("masked")
    header = {**model.header, "kind": "string_vae", "kit": "toy"}
    path = tmp_path / "weights.safetensors"
    path.write_bytes(checkpoint_bytes(model.module.state_dict(), header))
    read = load_string_vae(path, {"kit": "toy"})
    points = np.random.default_rng(3).standard_normal((9, 8)).astype(np.float32)
    assert read.decode(points, None) == model.decode(points, None)
    np.testing.assert_array_equal(read.encode(toy_strings()[:3]), model.encode(toy_strings()[:3]))
    with pytest.raises(CheckpointError, match="of another kit: 'toy', and 'castle' is asked for"):
        load_string_vae(path, {"kit": "castle"})


def test_low_temperature_decodes_the_likeliest_string() -> None:
    model = random_vae("masked")
    points = np.random.default_rng(3).standard_normal((64, 8)).astype(np.float32)
    likeliest = model.decode(points, None)
    same = [
        sum(a == b for a, b in zip(likeliest, model.decode(points, np.random.default_rng(0), value), strict=True))
        for value in (1e-9, 0.1, 1.0)
    ]
    assert same[0] == 64
    assert same[0] > same[1] > same[2]
