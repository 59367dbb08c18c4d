"""The string VAE: an encoder, a latent space, and three decoders (strings §5)."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from stages.training.string_vae.settings import StringVaeConfig
from stages.training.string_vae.vocabulary import END_TOKEN
from stages.training.transformer import TransformerBlock

DecoderState = list[Tensor]


class StringVae(nn.Module):
    """A VAE of strings of token numbers.

    The encoder is a bidirectional GRU. The decoder predicts one token after another and sees the latent point at each,
    as in the model that the paper builds on.
    """

    def __init__(self, config: StringVaeConfig, tokens: int, cycles: int, longest: int) -> None:
        """Build a model of `tokens` token numbers; the last `cycles` of them are cycle numbers."""
        super().__init__()
        self.embedding = nn.Embedding(tokens, config.embedding)
        self.readers = nn.ModuleList(nn.GRU(config.embedding, config.hidden // 2, batch_first=True) for _ in range(2))
        self.mean = nn.Linear(config.hidden, config.latent)
        self.log_variance = nn.Linear(config.hidden, config.latent)
        self.decoder: TokenDecoder
        if config.decoder == "transformer":
            self.decoder = TransformerDecoder(config, tokens, longest)
        else:
            self.decoder = GruDecoder(config, tokens)
        attends = config.cycle_attention and config.decoder != "plain"
        self.cycle_attention = CycleAttention(config.hidden, tokens, cycles) if attends else None

    def encode(self, codes: Tensor, lengths: Tensor) -> tuple[Tensor, Tensor]:
        """Return mean and logarithm of the variance, float (n, latent) each.

        codes: int64 (n, longest); tokens behind the end are ignored.
        lengths: int64 (n,).
        """
        last = (lengths.to(codes.device) - 1)[:, None]
        backwards = (last - torch.arange(codes.shape[1], device=codes.device)).clamp(min=0)
        # A packed sequence would be one call, but slow training down by a factor of four.
        summary = torch.cat(
            [
                torch.take_along_dim(reader(self.embedding(read))[0], last[:, :, None], dim=1)[:, 0]
                for reader, read in zip(self.readers, (codes, torch.gather(codes, 1, backwards)), strict=True)
            ],
            dim=-1,
        )
        return self.mean(summary), self.log_variance(summary)

    def decode(self, before: Tensor, points: Tensor, open_until: Tensor, hidden: Tensor | None = None) -> Tensor:
        """Return the logits of each token, float (n, longest, tokens).

        before: int64 (n, longest), the token before each.
        points: float (n, latent).
        open_until: int64 (n, longest), for each token that opens a cycle the index of the one that closes it, else 0.
        hidden: bool (n, longest), inputs that the decoder sees as END_TOKEN instead.
        """
        logits: Tensor
        inputs = before if hidden is None else before.masked_fill(hidden, END_TOKEN)
        logits, states = self.decoder(inputs, points)
        if self.cycle_attention is not None:
            logits = self.cycle_attention(logits, states, before, open_until)
        return logits

    def start(self, points: Tensor) -> DecoderState:
        """Return the state before the first token; its tensors have the strings first."""
        return self.decoder.start(points) + ([] if self.cycle_attention is None else self.cycle_attention.start(points))

    def step(self, tokens: Tensor, points: Tensor, state: DecoderState) -> tuple[Tensor, DecoderState]:
        """Return logits float (n, tokens) after tokens int64 (n,), and the next state."""
        if self.cycle_attention is None:
            logits, _, state = self.decoder.step(tokens, points, state)
            return logits, state
        *decoder_state, keys, is_open = state
        logits, states, decoder_state = self.decoder.step(tokens, points, decoder_state)
        logits, cycle_state = self.cycle_attention.step(logits, states, tokens, [keys, is_open])
        return logits, decoder_state + cycle_state


class CycleAttention(nn.Module):
    """Scores of closing each open cycle next, by attention to the states at which the cycles began: beyond the paper.

    A cycle number alone does not tell at which part its cycle began. Without this, a decoder has to memorise all open
    cycles, some fifty in a shape of a hundred parts.
    """

    WIDTH = 64

    def __init__(self, width: int, tokens: int, cycles: int) -> None:
        super().__init__()
        self.first, self.cycles = tokens - cycles, cycles
        self.query, self.key = nn.Linear(width, self.WIDTH), nn.Linear(width, self.WIDTH)

    def forward(self, logits: Tensor, states: Tensor, before: Tensor, open_until: Tensor) -> Tensor:
        """Add the scores of open cycles to the logits, float (n, longest, tokens).

        states: float (n, longest, width), of the decoder.
        before: int64 (n, longest), the token before each.
        """
        scores = self.query(states) @ self.key(states).transpose(1, 2) / self.WIDTH**0.5
        index = torch.arange(before.shape[1], device=before.device)
        # inputs are shifted by one against the string
        until = torch.cat([torch.zeros_like(open_until[:, :1]), open_until[:, :-1]], dim=1)
        is_open = (index <= index[:, None]) & (index[:, None] <= until[:, None])
        numbers = torch.arange(self.first, self.first + self.cycles, device=before.device)
        of_number = (scores * is_open) @ (before[..., None] == numbers).to(scores.dtype)
        return torch.cat([logits[..., : self.first], logits[..., self.first :] + of_number], dim=-1)

    def start(self, points: Tensor) -> DecoderState:
        """Return a key for each cycle number, float (n, cycles, width), and whether its cycle is open, bool (n,
        cycles)."""
        shape = (len(points), self.cycles)
        return [points.new_zeros(*shape, self.WIDTH), torch.zeros(shape, dtype=torch.bool, device=points.device)]

    def step(self, logits: Tensor, states: Tensor, before: Tensor, state: DecoderState) -> tuple[Tensor, DecoderState]:
        """Do the same for one token of each string: logits (n, tokens), states (n, width), before (n,)."""
        keys, is_open = state
        numbers = torch.arange(self.first, self.first + self.cycles, device=before.device)
        is_number = before[:, None] == numbers
        keys = torch.where(is_number[..., None], self.key(states)[:, None], keys)
        is_open = is_open ^ is_number
        scores = (keys @ self.query(states)[..., None])[..., 0] / self.WIDTH**0.5
        logits = torch.cat([logits[:, : self.first], logits[:, self.first :] + scores * is_open], dim=-1)
        return logits, [keys, is_open]


class TokenDecoder(nn.Module):
    """A decoder: `forward` for whole strings, `start` and `step` for one token after another.

    Both return logits, and the states that they are computed from.
    """

    def forward(self, before: Tensor, points: Tensor) -> tuple[Tensor, Tensor]:
        raise NotImplementedError

    def start(self, points: Tensor) -> DecoderState:
        raise NotImplementedError

    def step(self, tokens: Tensor, points: Tensor, state: DecoderState) -> tuple[Tensor, Tensor, DecoderState]:
        raise NotImplementedError


class GruDecoder(TokenDecoder):
    """A GRU that is initialised with the latent point and sees it with each token."""

    def __init__(self, config: StringVaeConfig, tokens: int) -> None:
        super().__init__()
        self.layers = config.layers
        self.embedding = nn.Embedding(tokens, config.embedding)
        self.first = nn.Linear(config.latent, config.hidden * config.layers)
        self.writer = nn.GRU(config.embedding + config.latent, config.hidden, config.layers, batch_first=True)
        self.logits = nn.Linear(config.hidden, tokens)

    def forward(self, before: Tensor, points: Tensor) -> tuple[Tensor, Tensor]:
        inputs = torch.cat([self.embedding(before), points[:, None].expand(-1, before.shape[1], -1)], dim=-1)
        states, _ = self.writer(inputs, self._hidden(self.start(points)))
        return self.logits(states), states

    def start(self, points: Tensor) -> DecoderState:
        return [torch.tanh(self.first(points)).view(len(points), self.layers, -1)]

    def step(self, tokens: Tensor, points: Tensor, state: DecoderState) -> tuple[Tensor, Tensor, DecoderState]:
        inputs = torch.cat([self.embedding(tokens), points], dim=-1)
        states, hidden = self.writer(inputs[:, None], self._hidden(state))
        return self.logits(states[:, 0]), states[:, 0], [hidden.transpose(0, 1)]

    def _hidden(self, state: DecoderState) -> Tensor:
        return state[0].transpose(0, 1).contiguous()


class TransformerDecoder(TokenDecoder):
    """A causal transformer; the latent point is added to each token."""

    def __init__(self, config: StringVaeConfig, tokens: int, longest: int) -> None:
        super().__init__()
        self.embedding = nn.Embedding(tokens, config.hidden)
        self.places = nn.Embedding(longest + 1, config.hidden)
        self.point = nn.Linear(config.latent, config.hidden)
        self.blocks = nn.ModuleList(TransformerBlock(config.hidden, config.dropout) for _ in range(config.layers))
        self.norm = nn.LayerNorm(config.hidden)
        self.logits = nn.Linear(config.hidden, tokens)

    def forward(self, before: Tensor, points: Tensor) -> tuple[Tensor, Tensor]:
        places = torch.arange(before.shape[1], device=before.device)
        inputs = self.embedding(before) + self.places(places) + self.point(points)[:, None]
        for block in self.blocks:
            inputs, _, _ = block(inputs, None)
        states = self.norm(inputs)
        return self.logits(states), states

    def start(self, points: Tensor) -> DecoderState:
        return [points.new_zeros(len(points), 0, self.embedding.embedding_dim) for _ in range(2 * len(self.blocks))]

    def step(self, tokens: Tensor, points: Tensor, state: DecoderState) -> tuple[Tensor, Tensor, DecoderState]:
        index = torch.full_like(tokens, state[0].shape[1])
        inputs = (self.embedding(tokens) + self.places(index) + self.point(points))[:, None]
        grown: DecoderState = []
        for number, block in enumerate(self.blocks):
            inputs, keys, values = block(inputs, (state[2 * number], state[2 * number + 1]))
            grown += [keys, values]
        states = self.norm(inputs[:, 0])
        return self.logits(states), states, grown


def shifted(codes: Tensor) -> Tensor:
    """Return the token before each, int64 (n, longest), END_TOKEN before the first."""
    return torch.cat([torch.full_like(codes[:, :1], END_TOKEN), codes[:, :-1]], dim=1)
