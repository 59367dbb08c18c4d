"""A transformer that says which word of a program comes next.

Beside the word before, it sees what the grammar knows of the next: its field, the cuboid that the line is about, the
one that the assembly expands, and the sizes of these.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from stages.training.program_lm.partial_program import SIZE_INPUTS
from stages.training.program_lm.settings import ProgramLmConfig
from stages.training.program_lm.tokens import NUMBER_STEPS, THIN_SHARE, VOCABULARY_SIZE, TokenField, field_words
from stages.training.program_vae.lines import SLOT_COUNT
from stages.training.program_vae.partial_assembly import MAX_DEPTH
from stages.training.transformer import TransformerBlock

Cache = list[tuple[Tensor, Tensor]]
"""Keys and values of each block, float (n, most, width) each."""


class ProgramLm(nn.Module):
    """`values`, float64 (fields, STEPS + 1), says what the steps of numbers stand for."""

    def __init__(self, entry: ProgramLmConfig, longest: int) -> None:
        super().__init__()
        self.words = nn.Embedding(VOCABULARY_SIZE, entry.width)
        self.cues = nn.ModuleList(
            nn.Embedding(many, entry.width) for many in (len(TokenField), SLOT_COUNT, SLOT_COUNT, MAX_DEPTH)
        )
        self.places = nn.Embedding(longest, entry.width)
        self.sizes = nn.Linear(SIZE_INPUTS, entry.width)
        self.blocks = nn.ModuleList(TransformerBlock(entry.width, entry.dropout) for _ in range(entry.layers))
        self.norm = nn.LayerNorm(entry.width)
        self.logits = nn.Linear(entry.width, VOCABULARY_SIZE)
        self.values: Tensor
        self.register_buffer("values", torch.zeros(len(TokenField), NUMBER_STEPS + 1, dtype=torch.float64))
        self.barred: Tensor
        self.register_buffer("barred", torch.from_numpy(~field_words()), persistent=False)

    def forward(self, before: Tensor, cues: Tensor, seen: Tensor, places: Tensor) -> Tensor:
        """Logits float (k, WORDS) of the words at `places` in programs x longest, int64 (k,), from the words before
        each, int64 (n, longest), and what is known of each, int64 (n, longest, 4) and float (n, longest, SEEN)."""
        states = self._embedded(before, cues, seen, torch.arange(before.shape[1], device=before.device))
        for block in self.blocks:
            states, _, _ = block(states, None)
        return self._said(states.flatten(0, 1)[places], cues.flatten(0, 1)[places])

    def start(self, count: int) -> Cache:
        """The cache of so many programs."""
        shape = (count, *self.places.weight.shape)
        return [(self.norm.weight.new_zeros(shape), self.norm.weight.new_zeros(shape)) for _ in self.blocks]

    def step(self, before: Tensor, cues: Tensor, seen: Tensor, places: Tensor, cache: Cache) -> Tensor:
        """Logits float (n, WORDS) of words at these places, int64 (n,); what is cached behind them does not count."""
        states = self._embedded(before, cues, seen, places)
        for block, (keys, values) in zip(self.blocks, cache, strict=True):
            assert isinstance(block, TransformerBlock)
            states = block.step(states, keys, values, places)
        return self._said(states, cues)

    def _embedded(self, before: Tensor, cues: Tensor, seen: Tensor, places: Tensor) -> Tensor:
        found: Tensor = self.words(before) + self.places(places) + self.sizes(torch.log1p(seen / THIN_SHARE))
        for number, table in enumerate(self.cues):
            found = found + table(cues[..., number])
        return found

    def _said(self, states: Tensor, cues: Tensor) -> Tensor:
        logits: Tensor = self.logits(self.norm(states)).float()
        return logits.masked_fill(self.barred[cues[..., 0]], -torch.inf)
