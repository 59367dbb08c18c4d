"""Shapes as sequences of cuboids, and the network that learns to write them."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from stages.shapeassembly import execute, parse
from stages.shapeassembly.extraction.boxes import boxes_match, corners_of_box
from stages.shapeassembly.extraction.validity import execution_boxes
from stages.training.box_vectors import box_from_vector, box_vector
from stages.training.cuboid_rnn.batches import END_KIND, CuboidCorpus, batch_of
from stages.training.cuboid_rnn.corpus import cuboid_rows, mirror_cuboids
from stages.training.cuboid_rnn.model import log_density
from stages.training.cuboid_rnn.settings import CuboidRnnConfig
from stages.training.cuboid_rnn.trained import TrainedCuboidRnn
from stages.training.cuboid_rnn.training import CuboidRnnTask, new_model
from tests.stages.training.program_vae.test_lines import BOX, STOOL

TWO_LEGS = """Assembly P { bbox = Cuboid(1.0, 1.0, 0.4, True)
top = Cuboid(1.0, 0.1, 0.4, True) leg = Cuboid(0.1, 0.9, 0.1, False)
attach(top, bbox, 0.5, 1.0, 0.5, 0.5, 1.0, 0.5) attach(leg, bbox, 0.5, 0.0, 0.5, 0.05, 0.0, 0.5)
attach(leg, top, 0.5, 1.0, 0.5, 0.2, 0.0, 0.5) reflect(leg, X) }"""
ENTRY = CuboidRnnConfig(name="tiny", kind="cuboid_rnn", hidden=48, mixtures=1, batch_size=2)


@pytest.mark.parametrize("text", [BOX, STOOL, TWO_LEGS])
def test_box_vectors_round_trip(text: str) -> None:
    for box in execution_boxes(execute(parse(text))):
        again = box_from_vector(box_vector(box))
        assert boxes_match(corners_of_box(box), corners_of_box(again), 1e-6)


def test_mirrored_pairs_count_once_and_rows_go_from_bottom_to_top() -> None:
    boxes = execution_boxes(execute(parse(TWO_LEGS)))
    rows = cuboid_rows(boxes)
    assert rows[:, 9].tolist() == [1, 0]
    assert (rows[0, 6:9] != 0).any(), "the leg leans"
    restored = [box_from_vector(row) for row in (*rows[:, :9], *mirror_cuboids(rows[:1, :9]))]
    for box in boxes:
        assert any(boxes_match(corners_of_box(box), corners_of_box(item), 1e-3) for item in restored)


def test_batch_has_a_step_per_axis_and_the_step_before_as_input() -> None:
    rows = cuboid_rows(execution_boxes(execute(parse(TWO_LEGS))))
    cuboids = CuboidCorpus.of([rows, rows[1:]])
    batch = batch_of(cuboids, np.array([0, 1]))
    assert batch.numbers.shape == (2, 9, 3)
    np.testing.assert_allclose(batch.numbers[0, :6].reshape(2, 3, 3).mT.flatten(1), rows[:, :9], atol=1e-6)
    assert batch.kinds.tolist() == [[3, 0, END_KIND], [0, END_KIND, END_KIND]]
    assert batch.flags[:, ::3].tolist() == [[[1, 1], [0, 0], [0, 0]], [[0, 0], [0, 0], [0, 0]]]
    assert batch.step_mask.sum(dim=1).tolist() == [6, 3]
    assert batch.kind_mask.sum(dim=1).tolist() == [3, 2]
    assert not batch.inputs[:, 0, :5].any()
    assert (batch.inputs[:, 1:, :3] == batch.numbers[:, :-1]).all()
    assert (batch.inputs[0, :, 5:].argmax(dim=-1) == torch.arange(9) % 3).all()


def test_log_density_matches_the_mixture_and_ignores_rotation_of_upright_cuboids() -> None:
    generator = torch.Generator().manual_seed(0)
    weights = torch.randn(1, 1, 2, generator=generator)
    means, numbers = torch.randn(1, 1, 2, 3, generator=generator), torch.randn(1, 1, 3, generator=generator)
    wide = torch.full((1, 1, 2, 3), 0.5)
    item = torch.distributions.Normal(means, wide).log_prob(numbers[:, :, None]).exp()
    shares = weights.softmax(dim=-1)
    for turned, some in ((0.0, item[..., :2]), (1.0, item)):
        wanted = (shares * some.prod(dim=-1)).sum(dim=-1).log()
        torch.testing.assert_close(log_density(weights, means, wide, numbers, torch.full((1, 1), turned)), wanted)


def test_network_learns_and_samples_two_shapes() -> None:
    shapes = [cuboid_rows(execution_boxes(execute(parse(text)))) for text in (BOX, TWO_LEGS)]
    cuboids = CuboidCorpus.of(shapes)
    learner = CuboidRnnTask(new_model(ENTRY, 0), {}, ENTRY, cuboids, cuboids)
    optimizer = torch.optim.Adam(learner.module.parameters(), lr=4e-3)
    noise = torch.Generator().manual_seed(0)
    stream = learner.batches(np.random.default_rng(0))
    for step in range(600):
        optimizer.param_groups[0]["lr"] = 8e-3 * (1 - step / 600)
        optimizer.zero_grad()
        torch.autograd.backward(learner.losses(next(stream), step, noise)["loss"])
        torch.nn.utils.clip_grad_norm_(learner.module.parameters(), 1.0)
        optimizer.step()
    with torch.no_grad():
        learner.validate(noise)
    model = TrainedCuboidRnn(learner.module.eval(), {})
    found, begun = model.sample(20, np.random.default_rng(0), 0.0)
    assert begun >= 20
    wanted = [execution_boxes(execute(parse(text))) for text in (BOX, TWO_LEGS)]
    alike = [
        sum(
            len(item) == len(boxes)
            and all(any(boxes_match(corners_of_box(a), corners_of_box(b), 0.1) for b in item) for a in boxes)
            for item in found
        )
        for boxes in wanted
    ]
    assert sum(alike) >= 16
    assert min(alike) >= 3
    again, _ = model.sample(20, np.random.default_rng(0), 0.0)
    for one, two in zip(found, again, strict=True):
        np.testing.assert_array_equal([item.center for item in one], [item.center for item in two])
