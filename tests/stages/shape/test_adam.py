"""Adam without PyTorch's compiler."""

from __future__ import annotations

import sys

import numpy as np
import pytest
import torch

from stages.shape.adam import Adam


def test_steps_are_those_of_adam_and_import_no_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "torch._dynamo", None)  # its import would raise
    weight = torch.nn.Parameter(torch.tensor([1.0, -2.0], dtype=torch.float64))
    optimizer = Adam([weight], lr=0.1)
    expected, mean, square = np.array([1.0, -2.0]), np.zeros(2), np.zeros(2)
    for step in range(1, 6):
        optimizer.zero_grad()
        torch.autograd.backward((weight**3).sum())
        optimizer.step()
        gradient = 3 * expected**2
        mean, square = 0.9 * mean + 0.1 * gradient, 0.999 * square + 0.001 * gradient**2
        expected = expected - 0.1 * mean / (1 - 0.9**step) / (np.sqrt(square / (1 - 0.999**step)) + 1e-8)
        optimizer.load_state_dict(optimizer.state_dict())
    np.testing.assert_allclose(weight.detach().numpy(), expected, rtol=1e-12)
    assert weight.grad is not None
    assert not weight.grad.requires_grad
