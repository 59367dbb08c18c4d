"""A linear probe finds categories from few labelled clouds: tall boxes and flat ones, by a network without training."""

from __future__ import annotations

import numpy as np

from eval.worth.categories import category_hits
from stages.training.point_encoder.clouds import LabelledClouds
from stages.training.point_encoder.training import new_model


def boxes(count: int, height: float, rng: np.random.Generator) -> LabelledClouds:
    clouds = (rng.random((200, 3)) * [1.0, height, 1.0] for _ in range(count))
    return LabelledClouds.of(((cloud, np.zeros(200, np.int32)) for cloud in clouds), 128, rng)


def test_tall_and_flat_boxes_are_distinguished_and_equal_ones_are_not() -> None:
    rng, encoder = np.random.default_rng(0), new_model(1).eval()
    before = {name: tensor.clone() for name, tensor in encoder.state_dict().items()}
    learnt = [("tall", boxes(4, 3.0, rng)), ("flat", boxes(4, 0.2, rng))]
    tested = [("flat", boxes(10, 0.2, rng)), ("tall", boxes(6, 3.0, rng))]
    assert category_hits(encoder, learnt, tested).tolist() == [100.0] * 16
    alike = [("tall", boxes(15, 1.0, rng)), ("flat", boxes(15, 1.0, rng))]
    assert 20 < category_hits(encoder, learnt, alike).mean() < 80
    assert all((before[name] == tensor).all() for name, tensor in encoder.state_dict().items())
