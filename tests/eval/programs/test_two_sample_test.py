"""The Fréchet distance against its closed form, features of the pretrained network, and the classifier test."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import sqrtm

from eval.programs.two_sample_test import (
    TwoSampleScores,
    classifier_acceptance,
    features_of,
    frechet_distance,
    two_sample_scores,
)


def test_frechet_distance_of_normal_distributions() -> None:
    rng = np.random.default_rng(0)
    first, second = rng.standard_normal((60, 5)), 1.5 * rng.standard_normal((80, 5)) + 0.3
    covariances = [np.cov(rows, rowvar=False) for rows in (first, second)]
    means = first.mean(axis=0) - second.mean(axis=0)
    root = np.real(sqrtm(covariances[0] @ covariances[1]))
    expected = means @ means + np.trace(covariances[0] + covariances[1] - 2 * root)
    assert frechet_distance(first, second) == pytest.approx(expected, rel=1e-9)
    assert frechet_distance(first, first) == pytest.approx(0, abs=1e-9)


def test_frechet_distance_with_fewer_samples_than_features() -> None:
    rng = np.random.default_rng(1)
    first = rng.standard_normal((10, 40))
    assert frechet_distance(first, first + 1.0) == pytest.approx(40.0)


def test_one_shape_has_no_covariance_and_teaches_no_classifier() -> None:
    clouds = np.random.default_rng(4).uniform(-1, 1, (2, 1024, 3))
    assert frechet_distance(clouds[:1, :5, 0], clouds[:, :5, 0]) == ""
    assert two_sample_scores(clouds[:1], clouds, features_of(clouds), 0) == TwoSampleScores("", "")


def test_features_do_not_depend_on_position_and_size() -> None:
    rng = np.random.default_rng(2)
    boxes = rng.uniform(-1, 1, (3, 1500, 3)) * [[[1.0, 1.0, 1.0]], [[1.0, 0.1, 1.0]], [[0.1, 1.0, 0.1]]]
    found, moved = features_of(boxes), features_of(4.0 * boxes + 2.0)
    assert found is not None
    assert moved is not None
    assert np.allclose(found, moved, atol=1e-3)
    assert np.linalg.norm(found[0] - found[1]) > 10 * np.linalg.norm(found - moved)
    assert features_of(boxes, Path("nowhere")) is None


def test_classifier_separates_flat_boxes_from_cubes_but_not_cubes() -> None:
    rng = np.random.default_rng(3)
    cubes = rng.uniform(-1, 1, (120, 64, 3))
    others = rng.uniform(-1, 1, (120, 64, 3))
    flat = others * [1.0, 0.2, 1.0]
    assert classifier_acceptance(flat, cubes, 0) == 0
    assert 20 < classifier_acceptance(others, cubes, 0) < 80
    assert classifier_acceptance(others, cubes, 0) == classifier_acceptance(others, cubes, 0)
