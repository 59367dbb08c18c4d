"""Steps that a GPU can take without waiting for what it has reckoned."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch

from stages.shapeassembly import execute, parse
from stages.shapeassembly.extraction.validity import boxes_of
from stages.training.cuboid_rnn.batches import Cuboids
from stages.training.cuboid_rnn.corpus import rows_of
from stages.training.cuboid_rnn.settings import CuboidRnnEntry
from stages.training.cuboid_rnn.training import CuboidRnnLearner
from stages.training.cuboid_rnn.training import new_model as new_cuboid_rnn
from stages.training.part_graph_vae.batches import Graphs
from stages.training.part_graph_vae.corpus import nodes_of
from stages.training.part_graph_vae.settings import PartGraphVaeEntry
from stages.training.part_graph_vae.training import PartGraphVaeLearner
from stages.training.part_graph_vae.training import new_model as new_part_graph_vae
from stages.training.program_lm.training import ProgramLmLearner
from stages.training.program_lm.training import new_model as new_program_lm
from stages.training.program_vae.batches import Programs
from stages.training.program_vae.lines import node_lines
from stages.training.program_vae.settings import ProgramVaeEntry
from stages.training.program_vae.training import ProgramVaeLearner
from stages.training.program_vae.training import new_model as new_program_vae
from stages.training.training_task import Learner
from tests.stages.training.program_lm.test_sampling import ENTRY, LONGEST, TEXTS, VALUES
from tests.stages.training.program_vae.test_lines import BOX, STOOL

FURNITURE = [parse(BOX), parse(STOOL)]


def program_vae() -> Learner:
    entry = ProgramVaeEntry(name="tiny", kind="program_vae", latent=4, hidden=8, batch=2)
    programs = Programs.of([node_lines(each) for each in FURNITURE])
    return ProgramVaeLearner(new_program_vae(entry, 0), {}, entry, programs, programs)


def program_lm() -> Learner:
    return ProgramLmLearner(new_program_lm(ENTRY, VALUES, LONGEST, 0), {}, ENTRY, TEXTS, TEXTS)


def cuboid_rnn() -> Learner:
    entry = CuboidRnnEntry(name="tiny", kind="cuboid_rnn", hidden=8, mixtures=2, batch=2)
    cuboids = Cuboids.of([rows_of(boxes_of(execute(each))) for each in FURNITURE])
    return CuboidRnnLearner(new_cuboid_rnn(entry, 0), {}, entry, cuboids, cuboids)


def part_graph_vae() -> Learner:
    entry = PartGraphVaeEntry(name="tiny", kind="part_graph_vae", latent=4, hidden=8, batch=2)
    graphs = Graphs.of([nodes_of(execute(each)) for each in FURNITURE])
    return PartGraphVaeLearner(new_part_graph_vae(entry, 0), {}, entry, graphs, graphs)


@pytest.mark.parametrize("made", [program_vae, program_lm, cuboid_rnn, part_graph_vae])
def test_a_step_asks_for_no_number_of_its_device_and_makes_every_tensor_there(
    made: Callable[[], Learner], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Tensors of the meta device have no numbers: whatever would wait for one, or mixes in another device, fails."""
    learner = made()
    for name in ("randn", "rand"):
        drawn = getattr(torch, name)

        def anyhow(*shape: Any, drawn: Callable[..., torch.Tensor] = drawn, **how: Any) -> torch.Tensor:
            return drawn(*shape, device=how["device"])

        monkeypatch.setattr(torch, name, anyhow)
    learner.module.to("meta")
    batch = next(learner.batches(np.random.default_rng(0)))
    loss = learner.losses(batch, 0, torch.Generator())["loss"]
    torch.autograd.backward(loss)
    assert loss.device.type == "meta"
    assert all(each.grad is not None for each in learner.module.parameters())
