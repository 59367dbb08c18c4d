"""Shapes as graphs of parts, and the VAE that learns to write them."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import torch

from pipeline.errors import Rejected
from stages.shapeassembly import execute, parse
from stages.shapeassembly.extraction.boxes import boxes_match, corners_of_box
from stages.shapeassembly.extraction.validity import execution_boxes
from stages.training.part_graph_vae.batches import GraphCorpus, batch_of
from stages.training.part_graph_vae.corpus import graph_nodes
from stages.training.part_graph_vae.settings import PartGraphVaeConfig
from stages.training.part_graph_vae.trained import TrainedPartGraphVae
from stages.training.part_graph_vae.training import PartGraphVaeTask, new_model, part_graph_reconstruction
from tests.stages.training.program_vae.test_lines import BOX, STOOL

ENTRY = PartGraphVaeConfig(name="tiny", kind="part_graph_vae", latent=8, hidden=48, batch_size=2, kl_weight=0.0)


@cache
def graphs() -> GraphCorpus:
    return GraphCorpus.of([graph_nodes(execute(parse(text))) for text in (BOX, STOOL)])


def test_nodes_are_assemblies_with_their_cuboids_and_copies() -> None:
    """The stool has its two legs in an assembly of their own, and a top with four copies."""
    nodes = graph_nodes(execute(parse(STOOL)))
    assert [node.below.tolist() for node in nodes] == [[1, -1, -1, -1, -1, -1], [-1, -1]]
    leaves = sum(int((node.below == -1).sum()) for node in nodes)
    assert leaves == len(execute(parse(STOOL)))
    for node in nodes:
        assert (node.touching == node.touching.T).all()
        assert not node.touching.diagonal().any()


def test_node_with_too_many_parts_is_rejected() -> None:
    many = BOX[:-1] + "translate(c, X, 13, 0.5) }"
    with pytest.raises(Rejected) as caught:
        graph_nodes(execute(parse(many)))
    assert caught.value.reason == "too many parts"


def test_loss_of_a_batch_is_the_sum_over_its_shapes() -> None:
    module = new_model(ENTRY, 1)
    points = torch.randn(2, ENTRY.latent, generator=torch.Generator().manual_seed(0))
    together = part_graph_reconstruction(module, batch_of(graphs(), np.array([0, 1])), points)
    alone = [
        part_graph_reconstruction(module, batch_of(graphs(), np.array([row])), points[row : row + 1]) for row in (0, 1)
    ]
    for whole, parts in zip(together, zip(*alone, strict=True), strict=True):
        assert whole.item() == pytest.approx(sum(part.item() for part in parts), rel=1e-5)
    means = module.encode(batch_of(graphs(), np.array([0, 1])))[0]
    for row in (0, 1):
        torch.testing.assert_close(module.encode(batch_of(graphs(), np.array([row])))[0][0], means[row])


def test_model_learns_and_samples_two_shapes() -> None:
    learner = PartGraphVaeTask(new_model(ENTRY, 0), {}, ENTRY, graphs(), graphs())
    optimizer = torch.optim.Adam(learner.module.parameters(), lr=3e-3)
    noise = torch.Generator().manual_seed(0)
    stream = learner.batches(np.random.default_rng(0))
    for step in range(250):
        optimizer.zero_grad()
        torch.autograd.backward(learner.losses(next(stream), step, noise)["loss"])
        torch.nn.utils.clip_grad_norm_(learner.module.parameters(), 1.0)
        optimizer.step()
    with torch.no_grad():
        learner.validate(noise)
        means = learner.module.encode(batch_of(graphs(), np.array([0, 1])))[0].numpy()
    model = TrainedPartGraphVae(learner.module.eval(), {})
    for text, found in zip((BOX, STOOL), model.decode(means), strict=True):
        wanted = execution_boxes(execute(parse(text)))
        assert len(found) == len(wanted)
        for box in wanted:
            assert any(boxes_match(corners_of_box(box), corners_of_box(item), 0.15) for item in found)
    one, other = (model.sample(5, np.random.default_rng(0)) for _ in range(2))
    assert one[1] == other[1] >= 5
    assert all(np.array_equal(a[0].center, b[0].center) for a, b in zip(one[0], other[0], strict=True))
