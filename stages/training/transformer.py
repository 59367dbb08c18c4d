"""The block of a transformer, for whole sequences and for one token after another."""

from __future__ import annotations

import torch
from torch import Tensor, cat, nn
from torch.nn.functional import scaled_dot_product_attention


def _heads(width: int, head: int) -> int:
    """About as many heads as `head` goes into the width, so that they share it evenly."""
    return next(number for number in range(max(width // head, 1), 0, -1) if width % number == 0)


class TransformerBlock(nn.Module):
    """Attention to what stands before, then two layers; normed first."""

    HEAD = 32

    def __init__(self, width: int, dropout: float = 0.0) -> None:
        super().__init__()
        self.dropout = nn.Dropout(dropout)
        self.heads = _heads(width, self.HEAD)
        self.attention_norm, self.feed_norm = nn.LayerNorm(width), nn.LayerNorm(width)
        self.projections, self.joined = nn.Linear(width, 3 * width), nn.Linear(width, width)
        self.feed = nn.Sequential(nn.Linear(width, 4 * width), nn.GELU(), nn.Linear(4 * width, width))

    def forward(self, seen: Tensor, before: tuple[Tensor, Tensor] | None) -> tuple[Tensor, Tensor, Tensor]:
        """What follows from float (n, tokens, width), and keys and values of all tokens so far, `before` among them;
        with these, `seen` is one token."""
        queries, keys, values = self.projections(self.attention_norm(seen)).chunk(3, dim=-1)
        if before is not None:
            keys, values = cat([before[0], keys], dim=1), cat([before[1], values], dim=1)
        return self._after(seen, queries, keys, values, None, before is None), keys, values

    def step(self, seen: Tensor, keys: Tensor, values: Tensor, places: Tensor) -> Tensor:
        """What follows from one token of each sequence, float (n, width), which stands at its place, int64 (n,), each
        at another; its key and value are put there into `keys` and `values`, float (n, most, width), of which those
        behind it do not count."""
        query, key, value = self.projections(self.attention_norm(seen)).chunk(3, dim=-1)
        rows, longest = torch.arange(len(seen), device=seen.device), int(places.max()) + 1
        keys[rows, places], values[rows, places] = key.to(keys.dtype), value.to(values.dtype)
        there = torch.arange(longest, device=seen.device) <= places[:, None]
        before = keys[:, :longest], values[:, :longest]
        return self._after(seen[:, None], query[:, None], *before, there[:, None, None], False)[:, 0]

    def _after(
        self, seen: Tensor, queries: Tensor, keys: Tensor, values: Tensor, there: Tensor | None, causal: bool
    ) -> Tensor:
        heads = [each.view(*each.shape[:2], self.heads, -1).transpose(1, 2) for each in (queries, keys, values)]
        mixed = scaled_dot_product_attention(heads[0], heads[1], heads[2], attn_mask=there, is_causal=causal)
        seen = seen + self.dropout(self.joined(mixed.transpose(1, 2).flatten(2)))
        found: Tensor = seen + self.dropout(self.feed(self.feed_norm(seen)))
        return found
