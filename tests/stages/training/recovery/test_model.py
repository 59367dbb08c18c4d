"""The network on CPUs and GPUs."""

from __future__ import annotations

import torch
from torch.nn.functional import max_pool2d

from stages.training.recovery.model import RecoveryNet, halve_resolution
from stages.training.recovery.settings import RecoveryModelConfig
from tests.stages.programs.stool import PROGRAM as STOOL


def test_pooling_for_gpus_equals_max_pooling() -> None:
    generator = torch.Generator().manual_seed(3)
    features = torch.randn(2, 3, 7, 10, generator=generator, requires_grad=True)
    weight = torch.randn(2, 3, 3, 5, generator=generator)
    expected, found = max_pool2d(features, 2), halve_resolution(features)
    assert torch.equal(found, expected)
    (wanted,) = torch.autograd.grad((expected * weight).sum(), features)
    (gradient,) = torch.autograd.grad((found * weight).sum(), features)
    torch.testing.assert_close(gradient, wanted)


def test_coordinates_have_full_precision_under_autocast() -> None:
    net = RecoveryNet(RecoveryModelConfig(name="small", points=64), STOOL.parameters)
    seen: list[torch.Tensor] = []
    net.encoder.convolutions[0].register_forward_hook(lambda _, __, features: seen.append(features))
    clouds = torch.rand(2, 64, 3, generator=torch.Generator().manual_seed(1)) - 0.5
    net(clouds)
    with torch.autocast("cpu", torch.bfloat16):
        net(clouds)
    assert torch.equal(*seen)
