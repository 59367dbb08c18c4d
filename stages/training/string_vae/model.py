"""The string VAE: an encoder, a latent space, and three decoders (strings §5)."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from stages.training.string_vae.settings import StringVaeEntry
from stages.training.string_vae.vocabulary import END
from stages.training.transformer import Block

__all__ = ["Decoder", "DecoderState", "StringVae", "shifted"]

DecoderState = list[Tensor]


class StringVae(nn.Module):
    """Strings of `tokens` kinds of tokens, to points of a latent space and back.

    The encoder is a GRU that reads a string both ways; the decoder writes one token after another, and sees the latent
    point at each (as in the model that the paper builds on).
    """

    def __init__(self, entry: StringVaeEntry, tokens: int, longest: int) -> None:
        super().__init__()
        self.embedding = nn.Embedding(tokens, entry.embedding)
        self.readers = nn.ModuleList(nn.GRU(entry.embedding, entry.hidden // 2, batch_first=True) for _ in range(2))
        self.mean = nn.Linear(entry.hidden, entry.latent)
        self.log_variance = nn.Linear(entry.hidden, entry.latent)
        self.decoder: Decoder
        if entry.decoder == "transformer":
            self.decoder = TransformerDecoder(entry, tokens, longest)
        else:
            self.decoder = GruDecoder(entry, tokens)

    def encode(self, codes: Tensor, lengths: Tensor) -> tuple[Tensor, Tensor]:
        """Mean and logarithm of the variance, float (n, latent) each, of strings int64 (n, longest) of these lengths
        int64 (n,); what stands behind a string does not count."""
        last = (lengths.to(codes.device) - 1)[:, None]
        backwards = (last - torch.arange(codes.shape[1], device=codes.device)).clamp(min=0)
        # A packed sequence would be one call, and in training take three times as long as all the rest.
        summary = torch.cat(
            [
                torch.take_along_dim(reader(self.embedding(read))[0], last[:, :, None], dim=1)[:, 0]
                for reader, read in zip(self.readers, (codes, torch.gather(codes, 1, backwards)), strict=True)
            ],
            dim=-1,
        )
        return self.mean(summary), self.log_variance(summary)

    def decode(self, shown: Tensor, points: Tensor) -> Tensor:
        """Logits float (n, longest, tokens) of each token of strings, where the decoder sees the tokens before it,
        int64 (n, longest), `shown`, and the latent point, float (n, latent)."""
        logits: Tensor = self.decoder(shown, points)
        return logits


class Decoder(nn.Module):
    """What all decoders do: `forward` for whole strings, `start` and `step` for one token after another."""

    def forward(self, shown: Tensor, points: Tensor) -> Tensor:
        raise NotImplementedError

    def start(self, points: Tensor) -> DecoderState:
        """The state before the first token of a string for each point; its tensors have the strings first."""
        raise NotImplementedError

    def step(self, shown: Tensor, points: Tensor, state: DecoderState) -> tuple[Tensor, DecoderState]:
        """Logits float (n, tokens) of the next token after tokens int64 (n,), and the next state."""
        raise NotImplementedError


class GruDecoder(Decoder):
    """A GRU that begins with the latent point and sees it beside each token."""

    def __init__(self, entry: StringVaeEntry, tokens: int) -> None:
        super().__init__()
        self.layers = entry.layers
        self.embedding = nn.Embedding(tokens, entry.embedding)
        self.first = nn.Linear(entry.latent, entry.hidden * entry.layers)
        self.writer = nn.GRU(entry.embedding + entry.latent, entry.hidden, entry.layers, batch_first=True)
        self.logits = nn.Linear(entry.hidden, tokens)

    def forward(self, shown: Tensor, points: Tensor) -> Tensor:
        seen = torch.cat([self.embedding(shown), points[:, None].expand(-1, shown.shape[1], -1)], dim=-1)
        written, _ = self.writer(seen, self._hidden(self.start(points)))
        logits: Tensor = self.logits(written)
        return logits

    def start(self, points: Tensor) -> DecoderState:
        return [torch.tanh(self.first(points)).view(len(points), self.layers, -1)]

    def step(self, shown: Tensor, points: Tensor, state: DecoderState) -> tuple[Tensor, DecoderState]:
        seen = torch.cat([self.embedding(shown), points], dim=-1)
        written, hidden = self.writer(seen[:, None], self._hidden(state))
        return self.logits(written[:, 0]), [hidden.transpose(0, 1)]

    def _hidden(self, state: DecoderState) -> Tensor:
        return state[0].transpose(0, 1).contiguous()


class TransformerDecoder(Decoder):
    """A transformer whose tokens see those before them, the latent point added to each."""

    def __init__(self, entry: StringVaeEntry, tokens: int, longest: int) -> None:
        super().__init__()
        self.embedding = nn.Embedding(tokens, entry.hidden)
        self.places = nn.Embedding(longest + 1, entry.hidden)
        self.point = nn.Linear(entry.latent, entry.hidden)
        self.blocks = nn.ModuleList(Block(entry.hidden) for _ in range(entry.layers))
        self.norm = nn.LayerNorm(entry.hidden)
        self.logits = nn.Linear(entry.hidden, tokens)

    def forward(self, shown: Tensor, points: Tensor) -> Tensor:
        places = torch.arange(shown.shape[1], device=shown.device)
        seen = self.embedding(shown) + self.places(places) + self.point(points)[:, None]
        for block in self.blocks:
            seen, _, _ = block(seen, None)
        logits: Tensor = self.logits(self.norm(seen))
        return logits

    def start(self, points: Tensor) -> DecoderState:
        return [points.new_zeros(len(points), 0, self.embedding.embedding_dim) for _ in range(2 * len(self.blocks))]

    def step(self, shown: Tensor, points: Tensor, state: DecoderState) -> tuple[Tensor, DecoderState]:
        place = torch.full_like(shown, state[0].shape[1])
        seen = (self.embedding(shown) + self.places(place) + self.point(points))[:, None]
        grown: DecoderState = []
        for number, block in enumerate(self.blocks):
            seen, keys, values = block(seen, (state[2 * number], state[2 * number + 1]))
            grown += [keys, values]
        return self.logits(self.norm(seen[:, 0])), grown


def shifted(codes: Tensor) -> Tensor:
    """What a decoder sees at each place of strings int64 (n, longest): the token before it, at first the end."""
    return torch.cat([torch.full_like(codes[:, :1], END), codes[:, :-1]], dim=1)
