"""A transformer that predicts the next word of a program.

Besides the word before, its inputs are the grammar's context of the next word: its field, the line's cuboid, the cuboid
that the assembly expands, and their sizes.
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
"""Keys and values of each block, float (n, longest, width) each."""


class ProgramLm(nn.Module):
    """A language model of programs.

    values: float64 (fields, NUMBER_STEPS + 1), the number of each step.
    """

    def __init__(self, config: ProgramLmConfig, longest: int) -> None:
        super().__init__()
        self.words = nn.Embedding(VOCABULARY_SIZE, config.width)
        self.cues = nn.ModuleList(
            nn.Embedding(size, config.width) for size in (len(TokenField), SLOT_COUNT, SLOT_COUNT, MAX_DEPTH)
        )
        self.places = nn.Embedding(longest, config.width)
        self.sizes = nn.Linear(SIZE_INPUTS, config.width)
        self.blocks = nn.ModuleList(TransformerBlock(config.width, config.dropout) for _ in range(config.layers))
        self.norm = nn.LayerNorm(config.width)
        self.logits = nn.Linear(config.width, VOCABULARY_SIZE)
        self.values: Tensor
        self.register_buffer("values", torch.zeros(len(TokenField), NUMBER_STEPS + 1, dtype=torch.float64))
        self.barred: Tensor
        self.register_buffer("barred", torch.from_numpy(~field_words()), persistent=False)

    def forward(self, before: Tensor, cues: Tensor, sizes: Tensor, places: Tensor) -> Tensor:
        """Return logits, float (k, VOCABULARY_SIZE), of the words at some places.

        before: int64 (n, longest), the word before each.
        cues: int64 (n, longest, 4).
        sizes: float (n, longest, SIZE_INPUTS).
        places: int64 (k,), index in programs x longest.
        """
        states = self._embed(before, cues, sizes, torch.arange(before.shape[1], device=before.device))
        for block in self.blocks:
            states, _, _ = block(states, None)
        return self._masked_logits(states.flatten(0, 1)[places], cues.flatten(0, 1)[places])

    def start(self, count: int) -> Cache:
        """Return an empty cache for `count` programs."""
        shape = (count, *self.places.weight.shape)
        return [(self.norm.weight.new_zeros(shape), self.norm.weight.new_zeros(shape)) for _ in self.blocks]

    def step(self, before: Tensor, cues: Tensor, sizes: Tensor, places: Tensor, cache: Cache) -> Tensor:
        """Return logits, float (n, VOCABULARY_SIZE), of one word of each program.

        places: int64 (n,), the index of the word; cached entries behind it are ignored.
        """
        states = self._embed(before, cues, sizes, places)
        for block, (keys, values) in zip(self.blocks, cache, strict=True):
            assert isinstance(block, TransformerBlock)
            states = block.step(states, keys, values, places)
        return self._masked_logits(states, cues)

    def _embed(self, before: Tensor, cues: Tensor, sizes: Tensor, places: Tensor) -> Tensor:
        embedded: Tensor = self.words(before) + self.places(places) + self.sizes(torch.log1p(sizes / THIN_SHARE))
        for number, table in enumerate(self.cues):
            embedded = embedded + table(cues[..., number])
        return embedded

    def _masked_logits(self, states: Tensor, cues: Tensor) -> Tensor:
        logits: Tensor = self.logits(self.norm(states)).float()
        return logits.masked_fill(self.barred[cues[..., 0]], -torch.inf)
