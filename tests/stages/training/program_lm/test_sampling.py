"""What a language model learns, and what it writes whatever its weights say."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from stages.shapeassembly import execute, parse
from stages.shapeassembly.analysis.structure import signature
from stages.shapeassembly.syntax.checks import protruding_parts, violations
from stages.training.program_lm.batches import WordCorpus, WordSequence, batches
from stages.training.program_lm.corpus import word_sequence
from stages.training.program_lm.model import ProgramLm
from stages.training.program_lm.sampling import sample_words
from stages.training.program_lm.settings import ProgramLmConfig
from stages.training.program_lm.tokens import NUMBER_STEPS, VOCABULARY_SIZE, program_words, step_values
from stages.training.program_lm.trained import TrainedProgramLm
from stages.training.program_lm.training import FIRST_NUMBER_WORD, ProgramLmTask, jittered, new_model
from stages.training.program_vae.lines import START
from tests.stages.training.program_vae.test_lines import BOX, STOOL

ENTRY = ProgramLmConfig(name="tiny", kind="program_lm", width=32, layers=2, batch_size=2)
PROGRAMS = [parse(text) for text in (BOX, STOOL)]
WORDED = [program_words(program, 1.2) for program in PROGRAMS]
VALUES = step_values(WORDED)
READ = [item for item in (word_sequence(words, VALUES, 1.2) for words in WORDED) if item is not None]
TEXTS = WordCorpus.of(READ)
MAX_WORDS = 100


def trained(module: ProgramLm, top_p: float) -> TrainedProgramLm:
    return TrainedProgramLm(module.eval(), {"unit": 1.2}, top_p)


def test_batch_holds_programs_with_their_start() -> None:
    (batch,) = batches(TEXTS, 2, None)
    rows = (batch.places // batch.words.shape[1]).tolist()
    assert [rows.count(row) for row in range(2)] == [len(item.words) for item in READ]
    for row, item in enumerate(READ):
        np.testing.assert_array_equal(batch.words[row, : len(item.words)], item.words)
        assert batch.before[row, 0] == START
        assert batch.before[row, 1] == item.words[0]
        np.testing.assert_array_equal(batch.cues[row, : len(item.words)], item.cues)


@torch.no_grad()
def test_stepwise_logits_match_whole_programs_after_backtracking_too() -> None:
    module = new_model(ENTRY, VALUES, MAX_WORDS, 1)
    (batch,) = batches(TEXTS, 2, None)
    whole = torch.zeros(*batch.words.shape, VOCABULARY_SIZE)
    whole.flatten(0, 1)[batch.places] = module(batch.before, batch.cues, batch.sizes, batch.places)
    cache = module.start(2)
    # The second program is ahead of the first; the first goes back once, over places that hold other words.
    for first, second in [(0, 0), (1, 1), (2, 2), (3, 3), (1, 4), (2, 5), (3, 6), (4, 7)]:
        places = torch.tensor([first, second])
        rows = torch.arange(2)
        shown = batch.before[rows, places].clone()
        if (first, second) in [(2, 2), (3, 3)]:
            shown[0] = 20
        said = module.step(shown, batch.cues[rows, places], batch.sizes[rows, places], places, cache)
        torch.testing.assert_close(said[1], whole[1, second], atol=1e-4, rtol=1e-4)
        if shown[0] == batch.before[0, first]:
            torch.testing.assert_close(said[0], whole[0, first], atol=1e-4, rtol=1e-4)


def test_jitter_shifts_only_numbers_by_one_step() -> None:
    before = torch.arange(VOCABULARY_SIZE).repeat(400, 1)
    found = jittered(before, 0.2, torch.Generator().manual_seed(0))
    moved = (found - before)[:, FIRST_NUMBER_WORD:]
    assert (found[:, :FIRST_NUMBER_WORD] == before[:, :FIRST_NUMBER_WORD]).all()
    assert set(moved.unique().tolist()) == {-1, 0, 1}
    assert found.max() == VOCABULARY_SIZE - 1
    assert (moved != 0).float().mean().item() == pytest.approx(0.2 * NUMBER_STEPS / (NUMBER_STEPS + 1), abs=0.01)


def test_words_are_sampled_by_probability_among_allowed_top_p() -> None:
    shares = np.array([0.5, 0.3, 0.15, 0.05])
    allowed = np.array([True, True, True, True])
    rows = 20_000

    def found(top_p: float, temperature: float, allowed: np.ndarray) -> np.ndarray:
        logits = np.tile(np.log(shares), (rows, 1))
        words = sample_words(
            logits, np.tile(allowed, (rows, 1)), temperature, np.full(rows, top_p), np.random.default_rng(0)
        )
        return np.bincount(words, minlength=4) / rows

    np.testing.assert_allclose(found(1.0, 1.0, allowed), shares, atol=0.01)
    np.testing.assert_allclose(found(0.7, 1.0, allowed), [0.625, 0.375, 0, 0], atol=0.01)
    np.testing.assert_allclose(found(0.1, 1.0, allowed), [1, 0, 0, 0])
    np.testing.assert_allclose(found(1.0, 0.5, allowed), shares**2 / (shares**2).sum(), atol=0.01)
    allowed[0] = False
    np.testing.assert_allclose(found(0.9, 1.0, allowed), [0, 2 / 3, 1 / 3, 0], atol=0.01)


def test_model_learns_and_samples_two_programs() -> None:
    module = new_model(ENTRY, VALUES, MAX_WORDS, 0)
    learner = ProgramLmTask(module, {}, ENTRY, TEXTS, TEXTS)
    optimizer = torch.optim.Adam(module.parameters(), lr=3e-3)
    noise = torch.Generator().manual_seed(0)
    stream = learner.batches(np.random.default_rng(0))
    with torch.no_grad():
        before = learner.validate(noise)
    assert before["loss"] > before["numbers"] > 0
    for step in range(120):
        losses = learner.losses(next(stream), step, noise)
        optimizer.zero_grad()
        losses["loss"].backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(module.parameters(), 1.0)
        optimizer.step()
    with torch.no_grad():
        assert learner.validate(noise)["loss"] < 0.05 * before["loss"]
    programs, begun = trained(module, 0.9).sample(40, np.random.default_rng(0))
    assert begun == 40
    assert {signature(program) for program in programs} == {signature(program) for program in PROGRAMS}
    for program in programs:
        (wanted,) = [of for of in PROGRAMS if signature(of) == signature(program)]
        np.testing.assert_allclose(execute(program).corners, execute(wanted).corners, atol=0.03)


@pytest.mark.parametrize("seed", range(2))
def test_samples_keep_every_rule_and_their_box_with_random_weights(seed: int) -> None:
    module = new_model(ENTRY, VALUES, MAX_WORDS, seed)
    model = trained(module, 1.0)
    programs, begun = model.sample(8, np.random.default_rng(seed))
    assert begun > 8, "many are given up"
    for program in programs:
        assert violations(program) == []
        assert not any(protruding_parts(block) for block in program.blocks)
        execute(program)
    again, _ = model.sample(8, np.random.default_rng(seed))
    assert again == programs


def test_program_that_breaks_a_rule_has_no_word_sequence() -> None:
    twice = BOX[:-1] + "attach(c, bbox, 0.5, 0.0, 0.5, 0.5, 0.0, 0.5) }"
    found: WordSequence | None = word_sequence(program_words(parse(twice), 1.2), VALUES, 1.2)
    assert found is None
