"""Pairs, precision, and networks that learn which points belong to one part."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from eval.worth.learning import average_precision, precision_of_distance, precision_of_encoder, trained_encoder
from eval.worth.rows import mean_and_interval
from stages.training.point_encoder.clouds import LabelledClouds
from stages.training.point_encoder.network import MAX_PAIR_DISTANCE, near_point_pairs
from stages.training.point_encoder.training import new_model


def sheets(count: int, gap: float, rng: np.random.Generator) -> LabelledClouds:
    """Return clouds of two parallel sheets, each a part; the sheets are so close that distance tells little."""
    points = rng.random((count, 256, 3)) * [0.8, 0.0, 0.55]
    parts = rng.integers(0, 2, (count, 256))
    points[..., 1] = gap * parts
    return LabelledClouds((points - [0.4, 0.0, 0.275]).astype(np.float32), parts.astype(np.int32))


def test_average_precision_of_small_cases() -> None:
    scores, positive = np.array([0.9, 0.8, 0.7, 0.1]), np.array([True, False, True, False])
    assert average_precision(scores, positive) == pytest.approx((1 + 2 / 3) / 2)
    assert average_precision(-scores, positive) == pytest.approx((1 / 2 + 2 / 4) / 2)
    assert average_precision(scores, np.ones(4, dtype=bool)) == 1.0
    assert average_precision(scores, np.zeros(4, dtype=bool)) == 0.0


def test_near_pairs_are_those_within_the_distance_and_come_once() -> None:
    points = np.random.default_rng(0).random((2, 40, 3)).astype(np.float32)
    found = near_point_pairs(torch.from_numpy(points)).numpy()
    for cloud, pairs in zip(points.astype(float), found, strict=True):
        for first in range(40):
            for second in range(40):
                near = np.linalg.norm(cloud[first] - cloud[second]) < MAX_PAIR_DISTANCE
                assert pairs[first, second] == (near and first < second)


def test_network_learns_what_distance_does_not_tell() -> None:
    rng = np.random.default_rng(1)
    train, test = sheets(8, 0.05, rng), sheets(4, 0.05, rng)
    learnt = trained_encoder(new_model(0), train, 24, np.random.default_rng(2))
    assert precision_of_encoder(learnt, test).mean() > precision_of_distance(test).mean() + 10


def test_equal_seeds_give_equal_weights_and_leave_the_first_encoder_as_it_was() -> None:
    clouds = sheets(3, 0.1, np.random.default_rng(3))
    encoder = new_model(5)
    before = {name: tensor.clone() for name, tensor in encoder.state_dict().items()}
    ways = ("turn", "stretch", "jitter", "partial", "noise")
    first, second = (trained_encoder(encoder, clouds, 2, np.random.default_rng(4), ways).state_dict() for _ in range(2))
    assert all(torch.equal(first[name], second[name]) for name in first)
    assert all(torch.equal(before[name], tensor) for name, tensor in encoder.state_dict().items())
    assert not torch.equal(first["embedding.weight"], before["embedding.weight"])


def test_interval_covers_shapes_and_seeds() -> None:
    mean, half = mean_and_interval(np.array([[50.0, 70.0], [70.0, 90.0]]))
    assert mean == 70.0
    # both variances of the mean are 100: of shapes (60, 80), and of seeds (60, 80)
    assert half == pytest.approx(1.96 * np.sqrt(200.0))
    assert mean_and_interval(np.array([[50.0, 50.0]])) == (50.0, 0.0)
