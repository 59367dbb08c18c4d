"""The block of a transformer: whole sequences and one token after another, at any width."""

from __future__ import annotations

import pytest
import torch

from stages.training.transformer import TransformerBlock


@pytest.mark.parametrize("width", [2, 32, 100, 128, 130])
@torch.no_grad()
def test_stepwise_attention_matches_the_whole_sequence(width: int) -> None:
    torch.manual_seed(0)
    block = TransformerBlock(width)
    seen = torch.randn(3, 5, width)
    whole, _, _ = block(seen, None)
    before = (torch.zeros(3, 0, width),) * 2
    for token in range(5):
        one, *before = block(seen[:, token : token + 1], (before[0], before[1]))
        assert torch.allclose(one[:, 0], whole[:, token], atol=1e-5)
