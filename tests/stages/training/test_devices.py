"""Steps that a GPU can take without waiting for what it has reckoned."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch

from stages.shapeassembly import execute, parse
from stages.shapeassembly.extraction.validity import execution_boxes
from stages.training.cuboid_rnn.batches import CuboidCorpus
from stages.training.cuboid_rnn.corpus import cuboid_rows
from stages.training.cuboid_rnn.settings import CuboidRnnConfig
from stages.training.cuboid_rnn.training import CuboidRnnTask
from stages.training.cuboid_rnn.training import new_model as new_cuboid_rnn
from stages.training.part_graph_vae.batches import GraphCorpus
from stages.training.part_graph_vae.corpus import graph_nodes
from stages.training.part_graph_vae.settings import PartGraphVaeConfig
from stages.training.part_graph_vae.training import PartGraphVaeTask
from stages.training.part_graph_vae.training import new_model as new_part_graph_vae
from stages.training.program_lm.training import ProgramLmTask
from stages.training.program_lm.training import new_model as new_program_lm
from stages.training.program_vae.batches import ProgramCorpus
from stages.training.program_vae.lines import assembly_lines
from stages.training.program_vae.settings import ProgramVaeConfig
from stages.training.program_vae.training import ProgramVaeTask
from stages.training.program_vae.training import new_model as new_program_vae
from stages.training.training_task import TrainingTask
from tests.stages.training.program_lm.test_sampling import ENTRY, MAX_WORDS, TEXTS, VALUES
from tests.stages.training.program_vae.test_lines import BOX, STOOL

FURNITURE = [parse(BOX), parse(STOOL)]


def program_vae() -> TrainingTask:
    entry = ProgramVaeConfig(name="tiny", kind="program_vae", latent=4, hidden=8, batch_size=2)
    programs = ProgramCorpus.of([assembly_lines(item) for item in FURNITURE])
    return ProgramVaeTask(new_program_vae(entry, 0), {}, entry, programs, programs)


def program_lm() -> TrainingTask:
    return ProgramLmTask(new_program_lm(ENTRY, VALUES, MAX_WORDS, 0), {}, ENTRY, TEXTS, TEXTS)


def cuboid_rnn() -> TrainingTask:
    entry = CuboidRnnConfig(name="tiny", kind="cuboid_rnn", hidden=8, mixtures=2, batch_size=2)
    cuboids = CuboidCorpus.of([cuboid_rows(execution_boxes(execute(item))) for item in FURNITURE])
    return CuboidRnnTask(new_cuboid_rnn(entry, 0), {}, entry, cuboids, cuboids)


def part_graph_vae() -> TrainingTask:
    entry = PartGraphVaeConfig(name="tiny", kind="part_graph_vae", latent=4, hidden=8, batch_size=2)
    graphs = GraphCorpus.of([graph_nodes(execute(item)) for item in FURNITURE])
    return PartGraphVaeTask(new_part_graph_vae(entry, 0), {}, entry, graphs, graphs)


@pytest.mark.parametrize("made", [program_vae, program_lm, cuboid_rnn, part_graph_vae])
def test_step_never_reads_values_from_its_device(
    made: Callable[[], TrainingTask], monkeypatch: pytest.MonkeyPatch
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
    assert all(parameter.grad is not None for parameter in learner.module.parameters())
