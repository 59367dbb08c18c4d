"""Models of edge categories: an LSTM with independent tokens, and an autoregressive decoder (strings §6)."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from stages.strings.categories import DUMMY_CATEGORY
from stages.training.edge_categories.batches import CategoryBatch, CategoryTables
from stages.training.edge_categories.settings import EdgeCategoriesConfig
from stages.training.transformer import TransformerBlock


class EdgeCategoriesModel(nn.Module):
    """A model of edge categories."""

    def forward(self, batch: CategoryBatch) -> Tensor:
        """Return the logits of each token, float (n, longest, categories).

        Of the batch's categories, a token may depend on those of earlier tokens only.
        """
        raise NotImplementedError


class StringReader(nn.Module):
    """A bidirectional LSTM: the placement of a part also depends on later branches and cycle numbers."""

    def __init__(self, config: EdgeCategoriesConfig, codes: int) -> None:
        super().__init__()
        self.embedding = nn.Embedding(codes, config.embedding)
        sizes = [config.embedding, *(config.hidden for _ in range(config.layers - 1))]
        self.forwards = nn.ModuleList(nn.LSTM(size, config.hidden // 2, batch_first=True) for size in sizes)
        self.backwards = nn.ModuleList(nn.LSTM(size, config.hidden // 2, batch_first=True) for size in sizes)

    def forward(self, batch: CategoryBatch) -> Tensor:
        """Return the features of each token, float (n, longest, hidden)."""
        features: Tensor = self.embedding(batch.codes)
        # Each string is reversed on its own, so that padding stays behind it.
        token = torch.arange(features.shape[1], device=features.device)
        lengths = batch.lengths.to(features.device)[:, None]
        reverse = torch.where(token < lengths, lengths - 1 - token, token)
        for forwards, backwards in zip(self.forwards, self.backwards, strict=True):
            backward = _at(backwards(_at(features, reverse))[0], reverse)
            features = torch.cat([forwards(features)[0], backward], dim=-1)
        return features


class IndependentEdgeDecoder(EdgeCategoriesModel):
    """A reader and a dense layer: tokens are classified independently, as published."""

    def __init__(self, config: EdgeCategoriesConfig, codes: int, categories: int) -> None:
        super().__init__()
        self.reader = StringReader(config, codes)
        self.logits = nn.Linear(config.hidden, categories)

    def forward(self, batch: CategoryBatch) -> Tensor:
        logits: Tensor = self.logits(self.reader(batch))
        return logits


class AutoregressiveEdgeDecoder(EdgeCategoriesModel):
    """A reader, and a transformer that places parts one after another.

    A string does not tell left from right, so the right category depends on earlier choices. The inputs of a token are
    the reader's features of the token and of both ends of its edge, the frame of the parent, the frame of the other end
    if it is placed already, and the category and frame of the token before. Attention adds the inputs of all earlier
    tokens. Frames are computed from the categories, so the composition of rotations need not be learnt.

    poses: float (categories, 4, 4), as in `CategoryTables`.
    """

    def __init__(self, config: EdgeCategoriesConfig, codes: int, poses: Tensor) -> None:
        super().__init__()
        self.reader = StringReader(config, codes)
        self.poses: Tensor
        self.register_buffer("poses", poses, persistent=False)
        self.choice = nn.Embedding(len(poses), config.hidden)
        self.ends = nn.Linear(3 * config.hidden, config.hidden)
        self.places = nn.Sequential(
            nn.Linear(3 * 12, config.hidden), nn.GELU(), nn.Linear(config.hidden, config.hidden)
        )
        self.blocks = nn.ModuleList(TransformerBlock(config.hidden) for _ in range(config.layers))
        self.norm = nn.LayerNorm(config.hidden)
        self.logits = nn.Linear(config.hidden, len(poses))

    def forward(self, batch: CategoryBatch) -> Tensor:
        tokens = torch.arange(batch.codes.shape[1], device=batch.codes.device)
        states = self.inputs(batch, self.reader(batch), self.frames(batch), tokens)
        for block in self.blocks:
            states, _, _ = block(states, None)
        logits: Tensor = self.logits(self.norm(states))
        return logits

    @torch.no_grad()
    def frames(self, batch: CategoryBatch) -> Tensor:
        """Return the frame of each token, float (n, longest, 4, 4).

        It is the frame of the token's part, or the one that the part at the other end of a cycle must have.
        """
        frames = self.poses[batch.categories]
        for token in range(1, frames.shape[1]):
            frames[:, token] = self.step(frames, batch.here[:, token], frames[:, token])
        return frames

    def step(self, frames: Tensor, here: Tensor, pose: Tensor) -> Tensor:
        """Return the frames, float (n, 4, 4), of poses float (n, 4, 4) relative to tokens `here`, int64 (n,)."""
        composed: Tensor = _at(frames, here.clamp(min=0)[:, None])[:, 0] @ pose
        return composed

    def inputs(self, batch: CategoryBatch, features: Tensor, frames: Tensor, tokens: Tensor) -> Tensor:
        """Return the inputs of some tokens, float (n, t, width).

        features: float (n, longest, width), of the reader.
        frames: float (n, longest, 4, 4), correct for the tokens before.
        tokens: int64 (t,).
        """
        here, there = (torch.where(end < 0, tokens, end) for end in (batch.here[:, tokens], batch.there[:, tokens]))
        before = (tokens - 1).clamp(min=0).expand(len(features), -1)
        is_first = (tokens == 0)[:, None, None]
        ends = torch.cat([features[:, tokens], _at(features, here), _at(features, there)], dim=-1)
        start = _at(frames, torch.minimum(here, before))
        other = _inverse(start) @ _at(frames, torch.minimum(there, before))
        other = other.masked_fill((there >= tokens)[..., None, None], 0.0)
        last = _at(frames, before).masked_fill(is_first, 0.0)
        places = torch.cat([frame[..., :3, :].flatten(-2) for frame in (start, other, last)], dim=-1)
        choice = batch.categories.gather(1, before).masked_fill(tokens == 0, DUMMY_CATEGORY)
        inputs: Tensor = self.ends(ends) + self.places(places) + self.choice(choice)
        return inputs


def make_model(config: EdgeCategoriesConfig, tables: CategoryTables, cycles: int) -> EdgeCategoriesModel:
    """Build a model of a kit's categories, with `cycles` distinct cycle numbers."""
    codes = len(tables.masks) + 2 + cycles
    if config.decoder == "lstm":
        return IndependentEdgeDecoder(config, codes, len(tables.poses))
    return AutoregressiveEdgeDecoder(config, codes, torch.from_numpy(tables.poses))


def masked(logits: Tensor, allowed: Tensor) -> Tensor:
    """Mask logits to the allowed categories; rows that allow none stay unchanged."""
    return logits.masked_fill(~allowed & allowed.any(dim=-1, keepdim=True), -torch.inf)


def _at(values: Tensor, tokens: Tensor) -> Tensor:
    """Return the rows of float (n, longest, ...) at tokens int64 (n, longest)."""
    flat = values.flatten(2)
    rows: Tensor = flat.gather(1, tokens[..., None].expand(-1, -1, flat.shape[-1]))
    return rows.view(*tokens.shape, *values.shape[2:])


def _inverse(frames: Tensor) -> Tensor:
    """Return the inverse of rigid transforms (..., 4, 4)."""
    rotation = frames[..., :3, :3].transpose(-1, -2)
    inverse = torch.zeros_like(frames)
    inverse[..., :3, :3] = rotation
    inverse[..., :3, 3:] = -rotation @ frames[..., :3, 3:]
    inverse[..., 3, 3] = 1.0
    return inverse
