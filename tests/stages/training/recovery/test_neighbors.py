"""Nearest neighbours and edge maxima equal their definitions."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from stages.training.recovery.neighbors import _EdgeMaximumOnGpu, edge_maximum, nearest_neighbors


def distances(points: Tensor) -> Tensor:
    return torch.cdist(points.double(), points.double())


@pytest.mark.parametrize("features", [3, 5])
@given(seed=st.integers(0, 2**31), n=st.integers(1, 80), flat=st.booleans())
def test_neighbors_are_the_nearest(features: int, seed: int, n: int, flat: bool) -> None:
    rng = np.random.default_rng(seed)
    cloud = rng.normal(size=(2, n, features)).round(1)  # with points that coincide
    cloud[..., -1] *= not flat
    points = torch.from_numpy(cloud.astype(np.float32))
    k = min(n, 7)
    found = nearest_neighbors(points, k)
    assert all(len(set(row)) == k for row in found.flatten(0, 1).tolist())
    expected = distances(points).sort(dim=-1).values[..., :k]
    torch.testing.assert_close(distances(points).gather(-1, found).sort(dim=-1).values, expected, atol=2e-3, rtol=0)


def test_neighbors_have_full_precision_under_autocast() -> None:
    line = torch.stack([torch.linspace(0.4, 0.5, 50), torch.zeros(50)], dim=-1)[None]
    with torch.autocast("cpu", torch.bfloat16):
        found = nearest_neighbors(line, 3)
    expected = distances(line).sort(dim=-1).values[..., :3]
    torch.testing.assert_close(distances(line).gather(-1, found).sort(dim=-1).values, expected, atol=1e-4, rtol=0)


def test_neighbors_of_a_cloud_with_an_outlier() -> None:
    points = torch.rand(1, 300, 3, generator=torch.Generator().manual_seed(0))
    points[0, 7] = 1000.0
    found = nearest_neighbors(points, 5)
    expected = distances(points).sort(dim=-1).values[..., :5]
    torch.testing.assert_close(distances(points).gather(-1, found), expected, atol=1e-4, rtol=1e-4)


def test_edge_maximum_and_gradient_equal_those_of_all_edges() -> None:
    generator = torch.Generator().manual_seed(1)
    features = torch.randn(2, 30, 8, generator=generator, requires_grad=True)
    neighbors = torch.randint(30, (2, 30, 6), generator=generator)
    weight = torch.randn(2, 30, 4, generator=generator)
    own, others = features.chunk(2, dim=-1)
    edges = own[:, :, None] + others[torch.arange(2)[:, None, None], neighbors]
    expected = edges.amax(dim=2)
    (wanted,) = torch.autograd.grad((expected * weight).sum(), features)
    found = edge_maximum(features, neighbors)
    (gradient,) = torch.autograd.grad((found * weight).sum(), features)
    torch.testing.assert_close(found, expected)
    # a neighbour listed twice gets its gradient once here and in two halves there, with the same sum
    torch.testing.assert_close(gradient, wanted)
    at_once = _EdgeMaximumOnGpu.apply(features, neighbors)
    (gradient,) = torch.autograd.grad((at_once * weight).sum(), features)
    torch.testing.assert_close(at_once, expected)
    torch.testing.assert_close(gradient, wanted, atol=1e-4, rtol=0)


def test_gradient_for_gpus_restores_determinism() -> None:
    strict = torch.are_deterministic_algorithms_enabled()
    torch.use_deterministic_algorithms(True)
    try:
        features = torch.randn(1, 9, 4, requires_grad=True)
        _EdgeMaximumOnGpu.apply(features, torch.arange(9).repeat(1, 9, 1)).sum().backward()
        assert torch.are_deterministic_algorithms_enabled()
    finally:
        torch.use_deterministic_algorithms(strict)
    # a point is the maximum for all nine or for none
    assert set((features.grad[0, :, 2:]).round(decimals=4).unique().tolist()) == {0.0, 9.0}
