"""What a model learns, and what it writes whatever its weights say."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from stages.shapeassembly import execute, parse
from stages.shapeassembly.analysis.structure import signature
from stages.shapeassembly.syntax.checks import protruding_parts, violations
from stages.shapeassembly.syntax.program import BBOX
from stages.training.program_vae.batches import ProgramCorpus, batch_of
from stages.training.program_vae.lines import ATTACH, CUBOID, REFLECT, SQUEEZE, STOP, TRANSLATE, assembly_lines
from stages.training.program_vae.model import ProgramVae
from stages.training.program_vae.partial_assembly import LineNumbers, PartialAssembly
from stages.training.program_vae.reaching import add_line
from stages.training.program_vae.settings import ProgramVaeConfig
from stages.training.program_vae.trained import TrainedProgramVae
from stages.training.program_vae.training import ProgramVaeTask, new_model, program_reconstruction
from tests.stages.training.program_vae.test_lines import BOX, STOOL

ENTRY = ProgramVaeConfig(name="tiny", kind="program_vae", latent=16, hidden=48, kl_weight=0.0, batch_size=2)
PROGRAMS = ProgramCorpus.of([assembly_lines(parse(text)) for text in (BOX, STOOL)])


def trained(module: ProgramVae) -> TrainedProgramVae:
    return TrainedProgramVae(module.eval(), {"settings": ENTRY.model_dump()})


def test_loss_of_a_batch_is_the_sum_over_its_programs() -> None:
    """Whatever stands in one batch, and whatever stands behind an end."""
    module = new_model(ENTRY, 1)
    codes = torch.randn(2, ENTRY.latent, generator=torch.Generator().manual_seed(0))
    together = program_reconstruction(module, batch_of(PROGRAMS, np.array([0, 1])), codes)
    alone = [
        program_reconstruction(module, batch_of(PROGRAMS, np.array([row])), codes[row : row + 1]) for row in (0, 1)
    ]
    for whole, parts in zip(together, zip(*alone, strict=True), strict=True):
        assert whole.item() == pytest.approx(sum(part.item() for part in parts), rel=1e-5)
    means = module.encode(batch_of(PROGRAMS, np.array([0, 1])))[0]
    for row in (0, 1):
        torch.testing.assert_close(module.encode(batch_of(PROGRAMS, np.array([row])))[0][0], means[row])


def test_model_learns_and_samples_two_programs() -> None:
    module = new_model(ENTRY, 0)
    learner = ProgramVaeTask(module, {}, ENTRY, PROGRAMS, PROGRAMS)
    optimizer = torch.optim.Adam(module.parameters(), lr=3e-3)
    noise = torch.Generator().manual_seed(0)
    stream = learner.batches(np.random.default_rng(0))
    with torch.no_grad():
        before = learner.validate(noise)["loss"]
    for step in range(300):
        losses = learner.losses(next(stream), step, noise)
        optimizer.zero_grad()
        losses["loss"].backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(module.parameters(), 1.0)
        optimizer.step()
    with torch.no_grad():
        assert learner.validate(noise)["loss"] < 0.1 * before
    model = trained(module)
    texts = [parse(text) for text in (BOX, STOOL)]
    written = model.decode(model.encode(texts), reject=True)
    for wanted, found in zip(texts, written, strict=True):
        assert found is not None
        assert signature(found) == signature(wanted)
        away = np.abs(execute(found).corners - execute(wanted).corners).max()
        assert away < 0.15


@pytest.mark.parametrize("seed", range(2))
def test_decoded_programs_keep_every_rule_with_random_weights(seed: int) -> None:
    module = new_model(ENTRY, seed)
    with torch.no_grad():
        for parameter in module.parameters():
            parameter.mul_(3.0)
    points = np.random.default_rng(seed).normal(size=(40, ENTRY.latent)).astype(np.float32)
    for reject in (True, False):
        programs = [string for string in trained(module).decode(points, reject=reject) if string is not None]
        for program in programs:
            assert violations(program) == []
            assert not any(protruding_parts(block) for block in program.blocks)
            execute(program)


NUMBERS = LineNumbers(np.array([0.5, 0.0, 0.5, 0.5, 0.0, 0.5]), 2, np.array([0.5, 0.5]), 0, 2, 0.5)


def draft() -> PartialAssembly:
    made = PartialAssembly((1.0, 1.0, 1.0))
    for _ in range(2):
        made.declare(np.array([0.2, 0.4, 2.0]), True, None)
    return made


def allowed(made: PartialAssembly) -> set[int]:
    return set(np.flatnonzero(made.commands()).tolist())


def choices(made: PartialAssembly, command: int) -> set[tuple[int, ...]]:
    logits = np.full(7, -1.0)
    logits[command] = 0.0
    return {choice[1:] for choice in made.choices(logits, np.zeros((7, 3, 11)), 100) if choice[0] == command}


def test_lines_follow_the_grammar_and_targets_are_grounded() -> None:
    made = draft()
    assert made.sizes[0] == (0.2, 0.4, 1.0)
    assert allowed(made) == {CUBOID, ATTACH, SQUEEZE}
    assert choices(made, ATTACH) == {(1, 0), (2, 0)}
    assert add_line(made, (ATTACH, 1, 0), NUMBERS, reaching=True)
    assert allowed(made) == {STOP, ATTACH, SQUEEZE, TRANSLATE, REFLECT}
    assert choices(made, ATTACH) == {(1, 0), (2, 0), (2, 1)}
    assert choices(made, REFLECT) == {(1,)}
    assert not add_line(made, (ATTACH, 1, 0), NUMBERS, reaching=True), "it is attached to the bottom already"
    assert add_line(made, (REFLECT, 1), NUMBERS, reaching=True)
    assert allowed(made) == {STOP, TRANSLATE, REFLECT}
    block = made.block("P", {})
    assert [cuboid.name for cuboid in block.cuboids] == ["cube0"], "the other is not grounded"


@pytest.mark.parametrize(
    ("goal", "kept"),
    [([0.5, 0.5, 0.5], False), ([0.5, 0.04, 0.5], True), ([0.5, 0.96, 0.5], False), ([0.95, 0, 0.5], True)],
)
def test_bounding_box_is_attached_to_at_its_ends_and_not_exceeded(goal: list[float], kept: bool) -> None:
    made = draft()
    numbers = LineNumbers(np.array([0.5, 0.0, 0.5, *goal]), 0, np.zeros(2), 0, 1, 0.0)
    assert add_line(made, (ATTACH, 1, 0), numbers, reaching=False) == kept
    assert (BBOX in str(made.block("P", {}).lines)) == kept
