"""A trained model of edge categories, read from its published weights beside the kit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from stages.shape.arrays import FloatArray, IntArray
from stages.shape.kit import Assembly, Kit
from stages.strings.categories import CategorySpace, NoCategoryError
from stages.strings.decoder import decode
from stages.strings.encoder import Encoded
from stages.training.checkpoint import load_checkpoint
from stages.training.edge_categories.batches import CategoryBatch, CategoryTables, batch_of, read_string
from stages.training.edge_categories.corpus import describe_space
from stages.training.edge_categories.model import AutoregressiveEdgeDecoder, EdgeCategoriesModel, make_model, masked
from stages.training.edge_categories.settings import EdgeCategoriesConfig

STRINGS_PER_BATCH = 64
"""Strings that are judged side by side."""
OWN_OPINION_SHARE = 0.05
"""Of the probability of a category after a vote, the share that is the string's own opinion."""


@dataclass(frozen=True)
class TrainedEdgeCategories:
    """What instantiation asks: where may the part of each token stand, and how likely is each place?

    Categories are those of `space`, whose docstring says how they put parts back; `scores` judges all tokens of a
    string at once, `steps` one after another, given the categories that were chosen for those before.

    header: what the weights say of themselves.
    """

    module: EdgeCategoriesModel
    space: CategorySpace
    header: Mapping[str, Any]

    def scores(self, string: str, others: Sequence[Encoded] = ()) -> FloatArray:
        """Log-probabilities of the categories of each token, float64 (tokens, categories), -inf where the mask is.

        A walker's are those after its own likeliest choices. With `others`, strings of the graph of `string` and the
        node of `string` at each of their nodes (`random_strings` of its decoded graph draws such), these have a say:
        see `vote`. Raises StringError.
        """
        (own,) = self.log_probabilities([string], self.choose([string], None))
        nodes = len(decode(string, self.space.alphabet).types)
        ballots = self.vote([Encoded(string, np.arange(nodes)), *others]) if others else []
        if not ballots:
            return own
        weights = np.exp([each.log_probability - ballots[0].log_probability for each in ballots])
        voted = np.zeros_like(own)
        for each, weight in zip(ballots, weights / weights.sum(), strict=True):
            voted[np.arange(len(own)), each.categories[0]] += weight
        with np.errstate(divide="ignore"):
            found: FloatArray = np.log((1.0 - OWN_OPINION_SHARE) * voted + OWN_OPINION_SHARE * np.exp(own))
        return found

    def steps(self, strings: Sequence[str]) -> CategoryDecoding:
        """The strings, before their first tokens; the same string may stand there several times."""
        return CategoryDecoding(self, self._batch(strings))

    def choose(self, strings: Sequence[str], rng: np.random.Generator | None) -> list[IntArray]:
        """Categories of each string, int32 (tokens,): drawn by their probabilities, or, without `rng`, the likeliest of
        each token, given those before it."""
        found: list[IntArray] = []
        for start in range(0, len(strings), STRINGS_PER_BATCH):
            steps = self.steps(strings[start : start + STRINGS_PER_BATCH])
            for _ in range(steps.longest):
                scores = steps.scores()
                if rng is not None:
                    scores = scores + rng.gumbel(size=scores.shape)
                steps.take(scores.argmax(axis=1))
            found += steps.chosen()
        return found

    def vote(self, strings: Sequence[Encoded], likeliest: Sequence[IntArray] | None = None) -> list[VoteResult]:
        """Shapes of a graph, by what several strings of it say of them, the likeliest first.

        Each string proposes the shape that its likeliest categories make, those of `choose`, which are asked for unless
        they are given. Proposals whose cycles do not close fall
        through; the others are labelled along all strings, and each string says how likely it holds what it reads. In
        the paper strings vote on edges; but the frame of a part is that of the way to it, so what strings can compare
        are shapes. Strings that tell of a spanning tree each tell of other contacts: all of them have to hold.
        """
        texts = [each.string for each in strings]
        proposed: dict[tuple[tuple[int, ...], ...], list[IntArray]] = {}
        likeliest = self.choose(texts, None) if likeliest is None else likeliest
        told = [np.sort(each.nodes[decode(each.string, self.space.alphabet).edges], axis=1) for each in strings]
        ends = np.unique(np.concatenate(told), axis=0).astype(np.int32)
        for encoded, categories in zip(strings, likeliest, strict=True):
            try:
                placed = self.space.place(encoded.string, categories)
                order = np.argsort(encoded.nodes)
                shape = Assembly(placed.types[order], placed.poses[order], ends)
                read = [each.categories for each in self.space.label(shape, strings, either_hand=True)]
            except (NoCategoryError, ValueError):
                continue
            proposed[tuple(tuple(each.tolist()) for each in read)] = read
        ballots = []
        for read in proposed.values():
            judged = self.log_probabilities(texts, read)
            total = sum(
                float(of_string[np.arange(len(each)), each].sum()) for of_string, each in zip(judged, read, strict=True)
            )
            ballots.append(VoteResult(read, total / len(texts)))
        return sorted(ballots, key=lambda each: -each.log_probability)

    @property
    def is_masked(self) -> bool:
        """Whether only categories of a token's pair of labels have a probability."""
        return bool(self.header["settings"]["mask"])

    @torch.no_grad()
    def log_probabilities(self, strings: Sequence[str], categories: Sequence[IntArray]) -> list[FloatArray]:
        """Of each token given the categories of those before it, float64 (tokens, categories) each."""
        found: list[FloatArray] = []
        for start in range(0, len(strings), STRINGS_PER_BATCH):
            batch = self._batch(strings[start : start + STRINGS_PER_BATCH])
            for row, each in enumerate(categories[start : start + STRINGS_PER_BATCH]):
                batch.categories[row, : len(each)] = torch.from_numpy(each.astype(np.int64))
            logits = masked(self.module(batch).double(), batch.allowed)
            judged = torch.log_softmax(logits, dim=-1).numpy()
            found += [judged[row, :length] for row, length in enumerate(batch.lengths.tolist())]
        return found

    def _batch(self, strings: Sequence[str]) -> CategoryBatch:
        rows = [read_string(each, self.space.alphabet, self.header["cycles"]) for each in strings]
        batch = batch_of(rows, self.space.masks)
        return batch if self.is_masked else replace(batch, allowed=torch.ones_like(batch.allowed))


@dataclass(frozen=True)
class VoteResult:
    """A shape that was voted on: its categories along each string, and the mean over the strings of the logarithm of
    its probability."""

    categories: list[IntArray]
    log_probability: float


class CategoryDecoding:
    """Some strings on their way, token by token.

    Ask `scores`, choose, `take`, until `longest` tokens are taken; what is behind the end of a string does not count.
    """

    def __init__(self, model: TrainedEdgeCategories, batch: CategoryBatch) -> None:
        self._space, self._is_masked = model.space, model.is_masked
        self._module = model.module
        self._batch = batch
        self._types = np.full(batch.codes.shape, -1)  # of the part of each token, once a category tells it
        self.token = 0
        """The token that comes next."""
        self._logits: Tensor
        with torch.no_grad():
            if isinstance(self._module, AutoregressiveEdgeDecoder):
                self._known = self._module.reader(batch)
                self._frames = torch.eye(4).expand(*batch.codes.shape, 4, 4).clone()
                width = self._known.shape[-1]
                self._seen = [(torch.zeros(len(self), 0, width),) * 2 for _ in self._module.blocks]
            else:
                self._logits = self._module(batch)

    def __len__(self) -> int:
        return len(self._batch.codes)

    @property
    def longest(self) -> int:
        """Tokens of the longest string."""
        return int(self._batch.codes.shape[1])

    @torch.no_grad()
    def scores(self) -> FloatArray:
        """Log-probabilities of the next token of each string, float64 (strings, categories), given those taken; of the
        categories that are left by the labels and by the types of parts that are told already."""
        allowed = self._batch.allowed[:, self.token]
        logits = masked(self._next().double(), allowed)
        for ends, types in zip((self._batch.here, self._batch.there), self._space.types.T, strict=True):
            # Where nothing is left the part at the other end of a cycle has less to say than the parent.
            allowed = allowed & torch.from_numpy(self._fitting(ends[:, self.token].numpy(), types))
            logits = masked(logits, allowed)
        found: FloatArray = torch.log_softmax(logits, dim=-1).numpy()
        return found

    def take(self, categories: np.ndarray) -> None:
        """Choose the categories int (strings,) of the next token."""
        chosen = torch.from_numpy(np.asarray(categories, dtype=np.int64))
        self._batch.categories[:, self.token] = chosen
        there = self._batch.there[:, self.token].numpy()
        # Of a part that stands already nothing is told anew.
        rows = np.flatnonzero(there >= self.token)
        self._types[rows, there[rows]] = self._space.types[chosen.numpy()[rows], 1]
        if isinstance(self._module, AutoregressiveEdgeDecoder):
            here = self._batch.here[:, self.token]
            self._frames[:, self.token] = self._module.step(self._frames, here, self._module.poses[chosen])
        self.token += 1

    def keep(self, rows: np.ndarray) -> None:
        """Go on with some of the strings alone, int (k,), any of them as often as it stands there: for a search that
        keeps several ways."""
        index = torch.from_numpy(np.asarray(rows, dtype=np.int64))
        self._batch = CategoryBatch(**{name: each[index] for name, each in vars(self._batch).items()})
        self._types = self._types[rows]
        if isinstance(self._module, AutoregressiveEdgeDecoder):
            self._known, self._frames = self._known[index], self._frames[index]
            self._seen = [(keys[index], values[index]) for keys, values in self._seen]
        else:
            self._logits = self._logits[index]

    def chosen(self) -> list[IntArray]:
        """The categories that were taken for each string, int32 (tokens,) each."""
        lengths = np.minimum(self._batch.lengths.numpy(), self.token)
        taken = self._batch.categories.numpy().astype(np.int32)
        return [taken[row, :length] for row, length in enumerate(lengths.tolist())]

    def _fitting(self, parts: np.ndarray, types: np.ndarray) -> np.ndarray:
        """Which categories, by their types int (categories,) at one end, fit the parts there, by their tokens int
        (strings,), as far as the types of these are told; bool (strings, categories)."""
        of_parts = self._types[np.arange(len(self)), np.maximum(parts, 0)]
        untold = (parts < 0) | (of_parts < 0) | (not self._is_masked)
        fits: np.ndarray = untold[:, None] | (types == of_parts[:, None])
        return fits

    def _next(self) -> Tensor:
        if not isinstance(self._module, AutoregressiveEdgeDecoder):
            return self._logits[:, self.token]
        seen = self._module.seen(self._batch, self._known, self._frames, torch.tensor([self.token]))
        for number, block in enumerate(self._module.blocks):
            seen, keys, values = block(seen, self._seen[number])
            self._seen[number] = keys, values
        logits: Tensor = self._module.logits(self._module.norm(seen[:, 0]))
        return logits


def load_edge_categories(path: Path, kit: Kit) -> TrainedEdgeCategories:
    """The model in a file of weights, on the CPU, beside the kit that it was trained on.

    Raises CheckpointError for whatever is not one, or is of another kit: of another name, other labels, or types that
    dock in other ways.
    """
    space = CategorySpace(kit)
    expected = {"kind": "edge_categories", "kit": kit.name, **describe_space(space)}
    tensors, header = load_checkpoint(path, expected)
    entry = EdgeCategoriesConfig.model_validate({"name": "trained", **header["settings"]})
    module = make_model(entry, CategoryTables.of(space), header["cycles"])
    module.load_state_dict(tensors)
    return TrainedEdgeCategories(module.eval(), space, header)
