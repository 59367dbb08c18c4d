"""The string VAE: an encoder, a latent space, and three decoders (strings §5)."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from stages.training.string_vae.settings import StringVaeConfig
from stages.training.string_vae.vocabulary import END_TOKEN
from stages.training.transformer import TransformerBlock

DecoderState = list[Tensor]


class StringVae(nn.Module):
    """Strings of `tokens` kinds of tokens, to points of a latent space and back.

    The encoder is a GRU that reads a string both ways; the decoder writes one token after another, and sees the latent
    point at each (as in the model that the paper builds on).
    """

    def __init__(self, entry: StringVaeConfig, tokens: int, cycles: int, longest: int) -> None:
        """For `tokens` kinds of tokens, of which the last `cycles` are the numbers of cycles."""
        super().__init__()
        self.embedding = nn.Embedding(tokens, entry.embedding)
        self.readers = nn.ModuleList(nn.GRU(entry.embedding, entry.hidden // 2, batch_first=True) for _ in range(2))
        self.mean = nn.Linear(entry.hidden, entry.latent)
        self.log_variance = nn.Linear(entry.hidden, entry.latent)
        self.decoder: TokenDecoder
        if entry.decoder == "transformer":
            self.decoder = TransformerDecoder(entry, tokens, longest)
        else:
            self.decoder = GruDecoder(entry, tokens)
        looks_back = entry.cycle_attention and entry.decoder != "plain"
        self.ends = CycleEnds(entry.hidden, tokens, cycles) if looks_back else None

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

    def decode(self, shown: Tensor, points: Tensor, open_until: Tensor, hidden: Tensor | None = None) -> Tensor:
        """Logits float (n, longest, tokens) of each token of strings, where the decoder sees the tokens before it,
        int64 (n, longest), `shown`, and the latent point, float (n, latent).

        open_until: int64 (n, longest), for each token at which a cycle begins the place where it ends, else 0. hidden:
        bool (n, longest), whether something that is shown is kept from the decoder: it sees END in its place.
        """
        logits: Tensor
        seen = shown if hidden is None else shown.masked_fill(hidden, END_TOKEN)
        logits, written = self.decoder(seen, points)
        if self.ends is not None:
            logits = self.ends(logits, written, shown, open_until)
        return logits

    def start(self, points: Tensor) -> DecoderState:
        """The state before the first token of a string for each point; its tensors have the strings first."""
        return self.decoder.start(points) + ([] if self.ends is None else self.ends.start(points))

    def step(self, shown: Tensor, points: Tensor, state: DecoderState) -> tuple[Tensor, DecoderState]:
        """Logits float (n, tokens) of the next token after tokens int64 (n,), and the next state."""
        if self.ends is None:
            logits, _, state = self.decoder.step(shown, points, state)
            return logits, state
        *before, keys, is_open = state
        logits, written, before = self.decoder.step(shown, points, before)
        logits, looked = self.ends.step(logits, written, shown, [keys, is_open])
        return logits, before + looked


class CycleEnds(nn.Module):
    """How well each open cycle would end next, by what was written where it began: beyond the paper.

    A number says nothing by itself of the part at which its cycle began; without this a decoder has to keep in mind all
    that are open, some fifty in a shape of a hundred parts.
    """

    WIDTH = 64

    def __init__(self, written: int, tokens: int, cycles: int) -> None:
        super().__init__()
        self.first, self.cycles = tokens - cycles, cycles
        self.query, self.key = nn.Linear(written, self.WIDTH), nn.Linear(written, self.WIDTH)

    def forward(self, logits: Tensor, written: Tensor, shown: Tensor, open_until: Tensor) -> Tensor:
        """Logits float (n, longest, tokens) with those of the open numbers bettered. written: float (n, longest,
        width), what the decoder had written when it saw `shown`."""
        scores = self.query(written) @ self.key(written).transpose(1, 2) / self.WIDTH**0.5
        place = torch.arange(shown.shape[1], device=shown.device)
        # what is shown at a place stood in the string one place before
        until = torch.cat([torch.zeros_like(open_until[:, :1]), open_until[:, :-1]], dim=1)
        is_open = (place <= place[:, None]) & (place[:, None] <= until[:, None])
        numbers = torch.arange(self.first, self.first + self.cycles, device=shown.device)
        of_number = (scores * is_open) @ (shown[..., None] == numbers).to(scores.dtype)
        return torch.cat([logits[..., : self.first], logits[..., self.first :] + of_number], dim=-1)

    def start(self, points: Tensor) -> DecoderState:
        """A key for each number, float (n, cycles, width), and whether its cycle is open, bool (n, cycles)."""
        shape = (len(points), self.cycles)
        return [points.new_zeros(*shape, self.WIDTH), torch.zeros(shape, dtype=torch.bool, device=points.device)]

    def step(self, logits: Tensor, written: Tensor, shown: Tensor, state: DecoderState) -> tuple[Tensor, DecoderState]:
        """The same for one token of each string: logits (n, tokens), written (n, width), shown (n,)."""
        keys, is_open = state
        numbers = torch.arange(self.first, self.first + self.cycles, device=shown.device)
        is_shown = shown[:, None] == numbers
        keys = torch.where(is_shown[..., None], self.key(written)[:, None], keys)
        is_open = is_open ^ is_shown
        scores = (keys @ self.query(written)[..., None])[..., 0] / self.WIDTH**0.5
        logits = torch.cat([logits[:, : self.first], logits[:, self.first :] + scores * is_open], dim=-1)
        return logits, [keys, is_open]


class TokenDecoder(nn.Module):
    """What all decoders do: `forward` for whole strings, `start` and `step` for one token after another. Each answers
    logits, and what it has written at each token, from which they come."""

    def forward(self, shown: Tensor, points: Tensor) -> tuple[Tensor, Tensor]:
        raise NotImplementedError

    def start(self, points: Tensor) -> DecoderState:
        raise NotImplementedError

    def step(self, shown: Tensor, points: Tensor, state: DecoderState) -> tuple[Tensor, Tensor, DecoderState]:
        raise NotImplementedError


class GruDecoder(TokenDecoder):
    """A GRU that begins with the latent point and sees it beside each token."""

    def __init__(self, entry: StringVaeConfig, tokens: int) -> None:
        super().__init__()
        self.layers = entry.layers
        self.embedding = nn.Embedding(tokens, entry.embedding)
        self.first = nn.Linear(entry.latent, entry.hidden * entry.layers)
        self.writer = nn.GRU(entry.embedding + entry.latent, entry.hidden, entry.layers, batch_first=True)
        self.logits = nn.Linear(entry.hidden, tokens)

    def forward(self, shown: Tensor, points: Tensor) -> tuple[Tensor, Tensor]:
        seen = torch.cat([self.embedding(shown), points[:, None].expand(-1, shown.shape[1], -1)], dim=-1)
        written, _ = self.writer(seen, self._hidden(self.start(points)))
        return self.logits(written), written

    def start(self, points: Tensor) -> DecoderState:
        return [torch.tanh(self.first(points)).view(len(points), self.layers, -1)]

    def step(self, shown: Tensor, points: Tensor, state: DecoderState) -> tuple[Tensor, Tensor, DecoderState]:
        seen = torch.cat([self.embedding(shown), points], dim=-1)
        written, hidden = self.writer(seen[:, None], self._hidden(state))
        return self.logits(written[:, 0]), written[:, 0], [hidden.transpose(0, 1)]

    def _hidden(self, state: DecoderState) -> Tensor:
        return state[0].transpose(0, 1).contiguous()


class TransformerDecoder(TokenDecoder):
    """A transformer whose tokens see those before them, the latent point added to each."""

    def __init__(self, entry: StringVaeConfig, tokens: int, longest: int) -> None:
        super().__init__()
        self.embedding = nn.Embedding(tokens, entry.hidden)
        self.places = nn.Embedding(longest + 1, entry.hidden)
        self.point = nn.Linear(entry.latent, entry.hidden)
        self.blocks = nn.ModuleList(TransformerBlock(entry.hidden, entry.dropout) for _ in range(entry.layers))
        self.norm = nn.LayerNorm(entry.hidden)
        self.logits = nn.Linear(entry.hidden, tokens)

    def forward(self, shown: Tensor, points: Tensor) -> tuple[Tensor, Tensor]:
        places = torch.arange(shown.shape[1], device=shown.device)
        seen = self.embedding(shown) + self.places(places) + self.point(points)[:, None]
        for block in self.blocks:
            seen, _, _ = block(seen, None)
        written = self.norm(seen)
        return self.logits(written), written

    def start(self, points: Tensor) -> DecoderState:
        return [points.new_zeros(len(points), 0, self.embedding.embedding_dim) for _ in range(2 * len(self.blocks))]

    def step(self, shown: Tensor, points: Tensor, state: DecoderState) -> tuple[Tensor, Tensor, DecoderState]:
        place = torch.full_like(shown, state[0].shape[1])
        seen = (self.embedding(shown) + self.places(place) + self.point(points))[:, None]
        grown: DecoderState = []
        for number, block in enumerate(self.blocks):
            seen, keys, values = block(seen, (state[2 * number], state[2 * number + 1]))
            grown += [keys, values]
        written = self.norm(seen[:, 0])
        return self.logits(written), written, grown


def shifted(codes: Tensor) -> Tensor:
    """What a decoder sees at each place of strings int64 (n, longest): the token before it, at first the end."""
    return torch.cat([torch.full_like(codes[:, :1], END_TOKEN), codes[:, :-1]], dim=1)
