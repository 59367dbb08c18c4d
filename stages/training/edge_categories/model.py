"""Models of edge categories: an LSTM that judges each token by itself, and a walker from part to part (strings §6)."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from stages.strings.categories import DUMMY_CATEGORY
from stages.training.edge_categories.batches import CategoryBatch, CategoryTables
from stages.training.edge_categories.settings import EdgeCategoriesConfig
from stages.training.transformer import TransformerBlock


class EdgeCategoriesModel(nn.Module):
    """What all models of edge categories do."""

    def forward(self, batch: CategoryBatch) -> Tensor:
        """Logits of each token, float (n, longest, categories). Of the categories of a batch only those of the tokens
        before may be looked at."""
        raise NotImplementedError


class StringReader(nn.Module):
    """An LSTM that reads a string both ways: where a part stands is also told by what comes, the branches that hang on
    it and the numbers that close cycles."""

    def __init__(self, entry: EdgeCategoriesConfig, codes: int) -> None:
        super().__init__()
        self.embedding = nn.Embedding(codes, entry.embedding)
        sizes = [entry.embedding, *(entry.hidden for _ in range(entry.layers - 1))]
        self.forwards = nn.ModuleList(nn.LSTM(size, entry.hidden // 2, batch_first=True) for size in sizes)
        self.backwards = nn.ModuleList(nn.LSTM(size, entry.hidden // 2, batch_first=True) for size in sizes)

    def forward(self, batch: CategoryBatch) -> Tensor:
        """What is known of each token, float (n, longest, hidden)."""
        known: Tensor = self.embedding(batch.codes)
        # Each string is turned around by itself: what is behind its end comes behind its beginning, and says nothing.
        token = torch.arange(known.shape[1], device=known.device)
        lengths = batch.lengths.to(known.device)[:, None]
        turned = torch.where(token < lengths, lengths - 1 - token, token)
        for forwards, backwards in zip(self.forwards, self.backwards, strict=True):
            known = torch.cat([forwards(known)[0], _at(backwards(_at(known, turned))[0], turned)], dim=-1)
        return known


class IndependentEdgeDecoder(EdgeCategoriesModel):
    """A reader and a dense layer: each token is judged by itself, as published."""

    def __init__(self, entry: EdgeCategoriesConfig, codes: int, categories: int) -> None:
        super().__init__()
        self.reader = StringReader(entry, codes)
        self.logits = nn.Linear(entry.hidden, categories)

    def forward(self, batch: CategoryBatch) -> Tensor:
        logits: Tensor = self.logits(self.reader(batch))
        return logits


class AutoregressiveEdgeDecoder(EdgeCategoriesModel):
    """A reader, and a transformer that walks the string with the parts that stand already before its eyes.

    A string does not tell left from right, nor how a flag is turned, so what is right depends on what was chosen
    before. At each token the walker sees what the reader knows of it and of both ends of its edge, the frame that it
    starts from, where the other end stands if it stands already, and the choice before and where that has led; and by
    attention what it saw at all tokens before. Frames follow from the categories: how turns add up need not be learnt.

    poses: float (categories, 4, 4), of the child's frame in its parent's, in the length of a part.
    """

    def __init__(self, entry: EdgeCategoriesConfig, codes: int, poses: Tensor) -> None:
        super().__init__()
        self.reader = StringReader(entry, codes)
        self.poses: Tensor
        self.register_buffer("poses", poses, persistent=False)
        self.choice = nn.Embedding(len(poses), entry.hidden)
        self.ends = nn.Linear(3 * entry.hidden, entry.hidden)
        self.places = nn.Sequential(nn.Linear(3 * 12, entry.hidden), nn.GELU(), nn.Linear(entry.hidden, entry.hidden))
        self.blocks = nn.ModuleList(TransformerBlock(entry.hidden) for _ in range(entry.layers))
        self.norm = nn.LayerNorm(entry.hidden)
        self.logits = nn.Linear(entry.hidden, len(poses))

    def forward(self, batch: CategoryBatch) -> Tensor:
        tokens = torch.arange(batch.codes.shape[1], device=batch.codes.device)
        seen = self.seen(batch, self.reader(batch), self.frames(batch), tokens)
        for block in self.blocks:
            seen, _, _ = block(seen, None)
        logits: Tensor = self.logits(self.norm(seen))
        return logits

    @torch.no_grad()
    def frames(self, batch: CategoryBatch) -> Tensor:
        """Where each token leads, float (n, longest, 4, 4): to the frame of its part, or to the one that the part at
        the other end of a cycle must have."""
        frames = self.poses[batch.categories]
        for token in range(1, frames.shape[1]):
            frames[:, token] = self.step(frames, batch.here[:, token], frames[:, token])
        return frames

    def step(self, frames: Tensor, here: Tensor, pose: Tensor) -> Tensor:
        """The frames float (n, 4, 4) that poses float (n, 4, 4) lead to from the tokens `here`, int64 (n,)."""
        led: Tensor = _at(frames, here.clamp(min=0)[:, None])[:, 0] @ pose
        return led

    def seen(self, batch: CategoryBatch, known: Tensor, frames: Tensor, tokens: Tensor) -> Tensor:
        """What the walker looks at before some tokens int64 (t,), float (n, t, width).

        known: float (n, longest, width), what the reader knows; frames: float (n, longest, 4, 4), those of the tokens
        before.
        """
        here, there = (torch.where(each < 0, tokens, each) for each in (batch.here[:, tokens], batch.there[:, tokens]))
        before = (tokens - 1).clamp(min=0).expand(len(known), -1)
        is_first = (tokens == 0)[:, None, None]
        ends = torch.cat([known[:, tokens], _at(known, here), _at(known, there)], dim=-1)
        start = _at(frames, torch.minimum(here, before))
        other = _inverse(start) @ _at(frames, torch.minimum(there, before))
        other = other.masked_fill((there >= tokens)[..., None, None], 0.0)
        last = _at(frames, before).masked_fill(is_first, 0.0)
        places = torch.cat([each[..., :3, :].flatten(-2) for each in (start, other, last)], dim=-1)
        choice = batch.categories.gather(1, before).masked_fill(tokens == 0, DUMMY_CATEGORY)
        seen: Tensor = self.ends(ends) + self.places(places) + self.choice(choice)
        return seen


def make_model(entry: EdgeCategoriesConfig, tables: CategoryTables, cycles: int) -> EdgeCategoriesModel:
    """A model of the categories of a kit, with cycle numbers below `cycles`."""
    codes = len(tables.masks) + 2 + cycles
    if entry.decoder == "lstm":
        return IndependentEdgeDecoder(entry, codes, len(tables.poses))
    return AutoregressiveEdgeDecoder(entry, codes, torch.from_numpy(tables.poses))


def masked(logits: Tensor, allowed: Tensor) -> Tensor:
    """Logits where only what is allowed has a probability; where nothing is, they stay as they are."""
    return logits.masked_fill(~allowed & allowed.any(dim=-1, keepdim=True), -torch.inf)


def _at(values: Tensor, tokens: Tensor) -> Tensor:
    """Rows of float (n, longest, ...) at tokens int64 (n, longest)."""
    flat = values.flatten(2)
    found: Tensor = flat.gather(1, tokens[..., None].expand(-1, -1, flat.shape[-1]))
    return found.view(*tokens.shape, *values.shape[2:])


def _inverse(frames: Tensor) -> Tensor:
    """Inverse of rigid transforms (..., 4, 4)."""
    turn = frames[..., :3, :3].transpose(-1, -2)
    inverse = torch.zeros_like(frames)
    inverse[..., :3, :3] = turn
    inverse[..., :3, 3:] = -turn @ frames[..., :3, 3:]
    inverse[..., 3, 3] = 1.0
    return inverse
