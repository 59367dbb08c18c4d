"""A trained string VAE, read from its published weights alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import torch

from stages.strings.alphabet import make_alphabet
from stages.strings.compiled_grammar import CompiledGrammar, compile_patterns
from stages.strings.decoder import decode
from stages.strings.encoder import canonical_string
from stages.strings.tokens import StringError
from stages.training.checkpoint import load_checkpoint
from stages.training.string_vae.decoding import PartialString, decode_codes
from stages.training.string_vae.model import StringVae
from stages.training.string_vae.settings import StringVaeConfig
from stages.training.string_vae.vocabulary import END_TOKEN, Vocabulary

LatentPoints = npt.NDArray[np.float32]
"""Points of a latent space, float32 (n, latent)."""

STRINGS_PER_BATCH = 256


@dataclass(frozen=True)
class TrainedStringVae:
    """header: what the weights say of themselves."""

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
        """Whether its decoder takes only tokens that can lead to a string of the grammar."""
        return bool(self.header["settings"]["decoder"] != "plain")

    def written_for(self, string: str) -> str:
        """What the decoder is to write for a string: the string itself, or the canonical one of its graph."""
        if not self.header["canonical"]:
            return string
        alphabet = self.vocabulary.alphabet
        graph = decode(string, alphabet)
        return canonical_string(graph.types, graph.edges, alphabet).string

    @torch.no_grad()
    def encode(self, strings: Sequence[str]) -> LatentPoints:
        """The mean of each string in the latent space. Raises StringError for a token that is not known, and ValueError
        for an empty string."""
        means: list[LatentPoints] = [np.empty((0, self.latent), np.float32)]
        device = next(self.module.parameters()).device
        for start in range(0, len(strings), STRINGS_PER_BATCH):
            codes = [
                np.append(self.vocabulary.codes(each), END_TOKEN).astype(np.int64)
                for each in strings[start : start + STRINGS_PER_BATCH]
            ]
            lengths = torch.tensor([len(each) for each in codes])
            padded = np.zeros((len(codes), int(lengths.max())), np.int64)
            for row, each in enumerate(codes):
                padded[row, : len(each)] = each
            mean, _ = self.module.encode(torch.from_numpy(padded).to(device), lengths)
            means.append(mean.cpu().numpy())
        return np.concatenate(means)

    def decode(
        self,
        points: LatentPoints,
        rng: np.random.Generator | None,
        temperature: float = 1.0,
        begun: Sequence[PartialString] = (),
    ) -> list[str]:
        """A string for each point: each token drawn at a temperature, or, without `rng`, the likeliest. Those that are
        `begun`, one for each point, go on from there.

        A plain decoder may answer what is no string; a masked one does so only if no string of the grammar is a tree.
        """
        rules = self.rules if self.is_masked else None
        most, cycles = self.header["most"], self.vocabulary.cycles
        written = decode_codes(self.module, points, most, rules, cycles, rng, temperature, begun)
        return [self.vocabulary.string(each) for each in written]

    def is_valid(self, string: str) -> bool:
        """Whether it is a string of the grammar that the model has learnt from (strings §5.1)."""
        from stages.strings.grammar_mask import follows_grammar

        try:
            codes = np.append(self.vocabulary.codes(string), END_TOKEN).astype(np.int64)
        except StringError:
            return False
        return follows_grammar(self.rules, self.vocabulary.cycles, codes)


def load_string_vae(path: Path, expected: Mapping[str, Any] | None = None) -> TrainedStringVae:
    """The string VAE in a file of weights, on the CPU.

    Raises CheckpointError for whatever is not one, or says something else of itself than `expected`, such as
    `{"kit": "castle"}`.
    """
    tensors, header = load_checkpoint(path, {"kind": "string_vae", **(expected or {})})
    vocabulary = Vocabulary(make_alphabet(header["names"]), header["cycles"])
    # weights from before there was `cycle_attention` have none
    entry = StringVaeConfig.model_validate({"name": "trained", "cycle_attention": False, **header["settings"]})
    module = StringVae(entry, len(vocabulary), header["cycles"], header["most"] + 1)
    module.load_state_dict(tensors)
    return TrainedStringVae(module.eval(), vocabulary, compile_patterns(header["patterns"], header["cycles"]), header)
