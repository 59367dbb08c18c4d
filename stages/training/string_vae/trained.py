"""A trained string VAE."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from stages.strings.compiled_grammar import CompiledGrammar, compile_patterns
from stages.strings.decoder import decode
from stages.strings.encoder import canonical_string
from stages.strings.tokens import StringError
from stages.training.checkpoint import load_module
from stages.training.latent import LatentPoints
from stages.training.string_vae.corpus import vocabulary_of
from stages.training.string_vae.decoding import PartialString, decode_codes
from stages.training.string_vae.model import StringVae
from stages.training.string_vae.settings import StringVaeConfig
from stages.training.string_vae.vocabulary import END_TOKEN, Vocabulary

STRINGS_PER_BATCH = 256


@dataclass(frozen=True)
class TrainedStringVae:
    """A string VAE with its vocabulary, the grammar of its kit, and its header."""

    module: StringVae
    vocabulary: Vocabulary
    rules: CompiledGrammar
    header: Mapping[str, Any]

    @property
    def latent(self) -> int:
        """Dimensions of the latent space."""
        return int(self.header["settings"]["latent"])

    @property
    def is_masked(self) -> bool:
        """Whether its decoder is restricted to tokens that can lead to a string of the grammar."""
        return bool(self.header["settings"]["decoder"] != "plain")

    def target_of(self, string: str) -> str:
        """Return the target of the decoder for a string: itself, or the canonical one of its graph."""
        if not self.header["canonical"]:
            return string
        alphabet = self.vocabulary.alphabet
        graph = decode(string, alphabet)
        return canonical_string(graph.types, graph.edges, alphabet).string

    @torch.no_grad()
    def encode(self, strings: Sequence[str]) -> LatentPoints:
        """Encode strings: posterior means, float32 (n, latent).

        Raises StringError for an unknown token, and ValueError for an empty string.
        """
        means: list[LatentPoints] = [np.empty((0, self.latent), np.float32)]
        device = next(self.module.parameters()).device
        for start in range(0, len(strings), STRINGS_PER_BATCH):
            codes = [
                np.append(self.vocabulary.codes(string), END_TOKEN).astype(np.int64)
                for string in strings[start : start + STRINGS_PER_BATCH]
            ]
            lengths = torch.tensor([len(string) for string in codes])
            padded = np.zeros((len(codes), int(lengths.max())), np.int64)
            for row, string in enumerate(codes):
                padded[row, : len(string)] = string
            mean, _ = self.module.encode(torch.from_numpy(padded).to(device), lengths)
            means.append(mean.cpu().numpy())
        return np.concatenate(means)

    def decode(
        self,
        points: LatentPoints,
        rng: np.random.Generator | None,
        temperature: float = 1.0,
        partial: Sequence[PartialString] = (),
    ) -> list[str]:
        """Decode each point to a string.

        rng: samples each token at a temperature; without it, the likeliest tokens are taken.
        partial: one string for each point to continue.
        A plain decoder may return what is no string; a masked one does so only if no string of the grammar is a tree.
        """
        rules = self.rules if self.is_masked else None
        max_tokens, cycles = self.header["max_tokens"], self.vocabulary.cycles
        codes = decode_codes(self.module, points, max_tokens, rules, cycles, rng, temperature, partial)
        return [self.vocabulary.string(string) for string in codes]

    def is_valid(self, string: str) -> bool:
        """Return whether a string is of the grammar that the model was trained on (strings §5.1)."""
        from stages.strings.grammar_mask import follows_grammar

        try:
            codes = np.append(self.vocabulary.codes(string), END_TOKEN).astype(np.int64)
        except StringError:
            return False
        return follows_grammar(self.rules, self.vocabulary.cycles, codes)


def load_string_vae(path: Path, expected: Mapping[str, Any] | None = None) -> TrainedStringVae:
    """Read the model in a file of weights, as `load_module`. expected: such as `{"kit": "castle"}`."""

    def build(config: StringVaeConfig, header: Mapping[str, Any]) -> StringVae:
        return StringVae(config, len(vocabulary_of(header)), header["cycles"], header["max_tokens"] + 1)

    module, header = load_module(path, {"kind": "string_vae", **(expected or {})}, StringVaeConfig, build)
    rules = compile_patterns(header["patterns"], header["cycles"])
    return TrainedStringVae(module, vocabulary_of(header), rules, header)
