"""The block of a causal transformer, for whole sequences and for one token after another."""

from __future__ import annotations

import torch
from torch import Tensor, cat, nn
from torch.nn.functional import scaled_dot_product_attention


def _head_count(width: int, head_width: int) -> int:
    """Return about `width / head_width` heads, a number that divides the width."""
    return next(number for number in range(max(width // head_width, 1), 0, -1) if width % number == 0)


class TransformerBlock(nn.Module):
    """Causal self-attention, then a perceptron of two layers, each after a layer norm."""

    HEAD_WIDTH = 32

    def __init__(self, width: int, dropout: float = 0.0) -> None:
        super().__init__()
        self.dropout = nn.Dropout(dropout)
        self.heads = _head_count(width, self.HEAD_WIDTH)
        self.attention_norm, self.feed_norm = nn.LayerNorm(width), nn.LayerNorm(width)
        self.projections, self.joined = nn.Linear(width, 3 * width), nn.Linear(width, width)
        self.feed = nn.Sequential(nn.Linear(width, 4 * width), nn.GELU(), nn.Linear(4 * width, width))

    def forward(self, inputs: Tensor, before: tuple[Tensor, Tensor] | None) -> tuple[Tensor, Tensor, Tensor]:
        """Return outputs, float (n, tokens, width), and the keys and values of all tokens so far.

        before: keys and values of the tokens before; `inputs` is then one token of each sequence.
        """
        queries, keys, values = self.projections(self.attention_norm(inputs)).chunk(3, dim=-1)
        if before is not None:
            keys, values = cat([before[0], keys], dim=1), cat([before[1], values], dim=1)
        return self._attend(inputs, queries, keys, values, None, before is None), keys, values

    def step(self, inputs: Tensor, keys: Tensor, values: Tensor, places: Tensor) -> Tensor:
        """Return the outputs of one token of each sequence, float (n, width).

        inputs: float (n, width).
        keys, values: float (n, longest, width); the token's own are written at its place, later ones are ignored.
        places: int64 (n,), the index of the token in each sequence.
        """
        query, key, value = self.projections(self.attention_norm(inputs)).chunk(3, dim=-1)
        rows, longest = torch.arange(len(inputs), device=inputs.device), int(places.max()) + 1
        keys[rows, places], values[rows, places] = key.to(keys.dtype), value.to(values.dtype)
        mask = torch.arange(longest, device=inputs.device) <= places[:, None]
        before = keys[:, :longest], values[:, :longest]
        return self._attend(inputs[:, None], query[:, None], *before, mask[:, None, None], False)[:, 0]

    def _attend(
        self, inputs: Tensor, queries: Tensor, keys: Tensor, values: Tensor, mask: Tensor | None, causal: bool
    ) -> Tensor:
        heads = [tensor.view(*tensor.shape[:2], self.heads, -1).transpose(1, 2) for tensor in (queries, keys, values)]
        mixed = scaled_dot_product_attention(heads[0], heads[1], heads[2], attn_mask=mask, is_causal=causal)
        inputs = inputs + self.dropout(self.joined(mixed.transpose(1, 2).flatten(2)))
        outputs: Tensor = inputs + self.dropout(self.feed(self.feed_norm(inputs)))
        return outputs
