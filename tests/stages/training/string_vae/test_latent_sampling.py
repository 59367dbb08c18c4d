"""Ways through the latent space: which points they ask at, and what counts as found."""

from __future__ import annotations

import numpy as np
import pytest

from stages.training.string_vae.latent_sampling import (
    SAMPLING_METHODS,
    gaussian_points,
    linear_points,
    path_points,
    perturb,
    sample,
)
from tests.stages.training.string_vae.models import random_vae, toy_strings


def test_points_of_a_line_are_equidistant() -> None:
    first, second = np.array([0.0, 1.0], np.float32), np.array([5.0, 1.0], np.float32)
    np.testing.assert_allclose(linear_points(first, second, 4), [[1, 1], [2, 1], [3, 1], [4, 1]], rtol=1e-6)


def test_path_is_split_at_the_samples_nearest_to_both_ends() -> None:
    samples = np.array([[0, 0], [8, 0], [4, 1], [2, 1], [6, -1], [100, 100]], np.float32)
    path = path_points(samples[0], samples[1], samples, 2)
    assert path.tolist() == [[0, 0], [4, 1], [8, 0]]
    path = path_points(samples[0], samples[1], samples, 4)
    assert path.tolist() == [[0, 0], [2, 1], [4, 1], [6, -1], [8, 0]]


def test_path_passes_no_sample_twice_and_ends_where_samples_do() -> None:
    rng = np.random.default_rng(0)
    samples = rng.standard_normal((40, 3)).astype(np.float32)
    path = path_points(samples[3], samples[7], samples, 32)
    assert path.shape == (33, 3)
    assert len(np.unique(path, axis=0)) == 33
    assert len(path_points(samples[3], samples[7], samples[:9], 32)) == 9


def test_gaussian_has_the_mean_and_the_covariance_of_its_samples() -> None:
    rng = np.random.default_rng(1)
    samples = (rng.standard_normal((50, 3)) @ [[2, 1, 0], [0, 1, 0], [0, 0, 0]] + [7, 0, -3]).astype(np.float32)
    drawn = gaussian_points(samples, 40_000, rng)
    assert drawn.dtype == np.float32
    np.testing.assert_allclose(drawn.mean(axis=0), samples.mean(axis=0), atol=0.05)
    np.testing.assert_allclose(np.cov(drawn.T), np.cov(samples.T, bias=True), atol=0.1)
    assert np.unique(drawn[:, 2]).tolist() == [-3], "nothing where the samples do not spread"


class Asked:
    """A model that notes the points it is asked at, and says what each is valid for."""

    latent = 3

    def __init__(self, answers: list[str]) -> None:
        self.answers, self.points = answers, []

    def decode(self, points: np.ndarray, rng: object) -> list[str]:
        self.points.append(points)
        return [self.answers[len(self.points) - 1]] * len(points)

    def is_valid(self, string: str) -> bool:
        return string != "invalid"


def test_offsets_grow_in_every_dimension_until_a_new_valid_string_is_found() -> None:
    model = Asked(["known", "invalid", "known", "new", "never asked"])
    found = perturb(model, np.zeros((1, 3), np.float32), [frozenset({"known"})], 0.25, np.random.default_rng(0))
    assert [(item.string, item.decoded, item.valid) for item in found] == [("new", 4, 3)]
    sizes = np.abs(np.concatenate(model.points))
    assert (np.diff(sizes, axis=0) > 0).all()
    assert sizes.max() <= 0.25


def test_failed_search_ends_at_the_maximum_offset() -> None:
    model = Asked(["invalid"] * 50)
    found = perturb(model, np.zeros((2, 3), np.float32), [frozenset()] * 2, 0.1, np.random.default_rng(0))
    assert [item.string for item in found] == [None, None]
    assert 0.09 <= np.abs(np.concatenate(model.points)).max() <= 0.1


@pytest.mark.parametrize("way", SAMPLING_METHODS)
def test_every_method_runs_the_requested_searches_and_finds_valid_strings(way: str) -> None:
    model, strings = random_vae("masked"), toy_strings()
    found = sample(model, way, strings, 10, np.random.default_rng(4))
    assert len(found) == 10
    assert all(model.is_valid(item.string) for item in found if item.string is not None)
    assert found == sample(model, way, strings, 10, np.random.default_rng(4))
    if way == "path":
        assert all(item.string not in strings for item in found)
