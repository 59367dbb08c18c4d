"""The network on one device and the other."""

from __future__ import annotations

import torch
from torch.nn.functional import max_pool2d

from stages.training.recovery.model import halved


def test_squares_are_halved_on_a_gpu_as_they_are_elsewhere() -> None:
    generator = torch.Generator().manual_seed(3)
    features = torch.randn(2, 3, 7, 10, generator=generator, requires_grad=True)
    weight = torch.randn(2, 3, 3, 5, generator=generator)
    expected, found = max_pool2d(features, 2), halved(features)
    assert torch.equal(found, expected)
    (wanted,) = torch.autograd.grad((expected * weight).sum(), features)
    (gradient,) = torch.autograd.grad((found * weight).sum(), features)
    torch.testing.assert_close(gradient, wanted)
