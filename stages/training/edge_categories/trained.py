"""A trained model of edge categories, which needs its kit."""

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
from stages.training.checkpoint import load_module
from stages.training.edge_categories.batches import CategoryBatch, CategoryTables, batch_of, read_string
from stages.training.edge_categories.corpus import describe_space
from stages.training.edge_categories.model import AutoregressiveEdgeDecoder, EdgeCategoriesModel, make_model, masked
from stages.training.edge_categories.settings import EdgeCategoriesConfig

STRINGS_PER_BATCH = 64
OWN_OPINION_SHARE = 0.05
"""Weight of a string's own probabilities after a vote."""


@dataclass(frozen=True)
class TrainedEdgeCategories:
    """Probabilities of the placement of each token's part, for instantiation.

    Categories are those of `space`. `scores` classifies all tokens of a string at once; `decoding` one after another,
    given the categories chosen before.
    """

    module: EdgeCategoriesModel
    space: CategorySpace
    header: Mapping[str, Any]

    def scores(self, string: str, others: Sequence[Encoded] = ()) -> FloatArray:
        """Return log-probabilities of the categories of each token, float64 (tokens, categories), -inf where masked.

        An autoregressive decoder is conditioned on its own likeliest choices.
        others: strings of the same graph, with the node of `string` at each of their nodes (`random_strings` of its
            decoded graph makes them). They vote on the result, see `vote`.
        Raises StringError.
        """
        (own,) = self.log_probabilities([string], self.choose([string], None))
        nodes = len(decode(string, self.space.alphabet).types)
        results = self.vote([Encoded(string, np.arange(nodes)), *others]) if others else []
        if not results:
            return own
        weights = np.exp([result.log_probability - results[0].log_probability for result in results])
        voted = np.zeros_like(own)
        for result, weight in zip(results, weights / weights.sum(), strict=True):
            voted[np.arange(len(own)), result.categories[0]] += weight
        with np.errstate(divide="ignore"):
            mixed: FloatArray = np.log((1.0 - OWN_OPINION_SHARE) * voted + OWN_OPINION_SHARE * np.exp(own))
        return mixed

    def decoding(self, strings: Sequence[str]) -> CategoryDecoding:
        """Start to decode strings token by token; a string may occur several times."""
        return CategoryDecoding(self, self._batch(strings))

    def choose(self, strings: Sequence[str], rng: np.random.Generator | None) -> list[IntArray]:
        """Choose the categories of each string, int32 (tokens,), given those before each token.

        They are sampled, or without `rng` the likeliest.
        """
        categories: list[IntArray] = []
        for start in range(0, len(strings), STRINGS_PER_BATCH):
            decoding = self.decoding(strings[start : start + STRINGS_PER_BATCH])
            for _ in range(decoding.longest):
                scores = decoding.scores()
                if rng is not None:
                    scores = scores + rng.gumbel(size=scores.shape)
                decoding.take(scores.argmax(axis=1))
            categories += decoding.categories()
        return categories

    def vote(self, strings: Sequence[Encoded], likeliest: Sequence[IntArray] | None = None) -> list[VoteResult]:
        """Let several strings of a graph vote on its shape. Returns the proposed shapes, the likeliest first.

        Each string proposes the shape of its likeliest categories. Proposals whose cycles do not close are dropped; the
        others are labelled along all strings, and their score is the mean log-probability. In the paper strings vote on
        edges, but the frame of a part depends on the path to it, so only whole shapes can be compared. Strings of
        spanning trees describe different contacts, and all of them have to hold.

        likeliest: the result of `choose`, computed unless given.
        """
        texts = [string.string for string in strings]
        proposed: dict[tuple[tuple[int, ...], ...], list[IntArray]] = {}
        likeliest = self.choose(texts, None) if likeliest is None else likeliest
        edges = [np.sort(string.nodes[decode(string.string, self.space.alphabet).edges], axis=1) for string in strings]
        contacts = np.unique(np.concatenate(edges), axis=0).astype(np.int32)
        for encoded, categories in zip(strings, likeliest, strict=True):
            try:
                placed = self.space.place(encoded.string, categories)
                order = np.argsort(encoded.nodes)
                shape = Assembly(placed.types[order], placed.poses[order], contacts)
                labels = [label.categories for label in self.space.label(shape, strings, either_hand=True)]
            except (NoCategoryError, ValueError):
                continue
            proposed[tuple(tuple(label.tolist()) for label in labels)] = labels
        results = []
        for labels in proposed.values():
            scores = self.log_probabilities(texts, labels)
            total = sum(
                float(score[np.arange(len(label)), label].sum()) for score, label in zip(scores, labels, strict=True)
            )
            results.append(VoteResult(labels, total / len(texts)))
        return sorted(results, key=lambda result: -result.log_probability)

    @property
    def is_masked(self) -> bool:
        """Whether only categories of a token's pair of labels have a probability."""
        return bool(self.header["settings"]["mask"])

    @torch.no_grad()
    def log_probabilities(self, strings: Sequence[str], categories: Sequence[IntArray]) -> list[FloatArray]:
        """Return log-probabilities given the categories of earlier tokens, float64 (tokens, categories) a string."""
        results: list[FloatArray] = []
        for start in range(0, len(strings), STRINGS_PER_BATCH):
            batch = self._batch(strings[start : start + STRINGS_PER_BATCH])
            for row, chosen in enumerate(categories[start : start + STRINGS_PER_BATCH]):
                batch.categories[row, : len(chosen)] = torch.from_numpy(chosen.astype(np.int64))
            logits = masked(self.module(batch).double(), batch.allowed)
            scores = torch.log_softmax(logits, dim=-1).numpy()
            results += [scores[row, :length] for row, length in enumerate(batch.lengths.tolist())]
        return results

    def _batch(self, strings: Sequence[str]) -> CategoryBatch:
        rows = [read_string(string, self.space.alphabet, self.header["cycles"]) for string in strings]
        batch = batch_of(rows, self.space.masks)
        return batch if self.is_masked else replace(batch, allowed=torch.ones_like(batch.allowed))


@dataclass(frozen=True)
class VoteResult:
    """A shape that strings voted on.

    categories: along each string, int32 (tokens,).
    log_probability: mean over the strings.
    """

    categories: list[IntArray]
    log_probability: float


class CategoryDecoding:
    """Strings that are decoded token by token.

    Call `scores`, choose, and `take`, until `longest` tokens are taken. Tokens behind the end of a string are ignored.
    """

    def __init__(self, model: TrainedEdgeCategories, batch: CategoryBatch) -> None:
        self._space, self._is_masked = model.space, model.is_masked
        self._module = model.module
        self._batch = batch
        self._types = np.full(batch.codes.shape, -1)  # part type at each token, -1 until a category determines it
        self.token = 0
        """Index of the next token."""
        self._logits: Tensor
        with torch.no_grad():
            if isinstance(self._module, AutoregressiveEdgeDecoder):
                self._features = self._module.reader(batch)
                self._frames = torch.eye(4).expand(*batch.codes.shape, 4, 4).clone()
                width = self._features.shape[-1]
                self._cache = [(torch.zeros(len(self), 0, width),) * 2 for _ in self._module.blocks]
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
        """Return log-probabilities of the next token of each string, float64 (strings, categories).

        Categories are restricted by the labels, and by the part types that are known already.
        """
        allowed = self._batch.allowed[:, self.token]
        logits = masked(self._next_logits().double(), allowed)
        for ends, types in zip((self._batch.here, self._batch.there), self._space.types.T, strict=True):
            # The parent comes first: where both ends allow nothing, the other end of a cycle is ignored.
            allowed = allowed & torch.from_numpy(self._fitting(ends[:, self.token].numpy(), types))
            logits = masked(logits, allowed)
        scores: FloatArray = torch.log_softmax(logits, dim=-1).numpy()
        return scores

    def take(self, categories: np.ndarray) -> None:
        """Choose the categories of the next token, int (strings,)."""
        chosen = torch.from_numpy(np.asarray(categories, dtype=np.int64))
        self._batch.categories[:, self.token] = chosen
        there = self._batch.there[:, self.token].numpy()
        # The type of a part that is placed already does not change.
        rows = np.flatnonzero(there >= self.token)
        self._types[rows, there[rows]] = self._space.types[chosen.numpy()[rows], 1]
        if isinstance(self._module, AutoregressiveEdgeDecoder):
            here = self._batch.here[:, self.token]
            self._frames[:, self.token] = self._module.step(self._frames, here, self._module.poses[chosen])
        self.token += 1

    def keep(self, rows: np.ndarray) -> None:
        """Continue with some rows, int (k,), which may repeat: for beam searches."""
        index = torch.from_numpy(np.asarray(rows, dtype=np.int64))
        self._batch = CategoryBatch(**{name: tensor[index] for name, tensor in vars(self._batch).items()})
        self._types = self._types[rows]
        if isinstance(self._module, AutoregressiveEdgeDecoder):
            self._features, self._frames = self._features[index], self._frames[index]
            self._cache = [(keys[index], values[index]) for keys, values in self._cache]
        else:
            self._logits = self._logits[index]

    def categories(self) -> list[IntArray]:
        """Return the categories taken so far, int32 (tokens,) a string."""
        lengths = np.minimum(self._batch.lengths.numpy(), self.token)
        taken = self._batch.categories.numpy().astype(np.int32)
        return [taken[row, :length] for row, length in enumerate(lengths.tolist())]

    def _fitting(self, parts: np.ndarray, types: np.ndarray) -> np.ndarray:
        """Return which categories fit the known part type at one end, bool (strings, categories).

        parts: int (strings,), the token of the part at that end, or -1.
        types: int (categories,), the part type at that end.
        """
        part_types = self._types[np.arange(len(self)), np.maximum(parts, 0)]
        unknown = (parts < 0) | (part_types < 0) | (not self._is_masked)
        fits: np.ndarray = unknown[:, None] | (types == part_types[:, None])
        return fits

    def _next_logits(self) -> Tensor:
        if not isinstance(self._module, AutoregressiveEdgeDecoder):
            return self._logits[:, self.token]
        states = self._module.inputs(self._batch, self._features, self._frames, torch.tensor([self.token]))
        for number, block in enumerate(self._module.blocks):
            states, keys, values = block(states, self._cache[number])
            self._cache[number] = keys, values
        logits: Tensor = self._module.logits(self._module.norm(states[:, 0]))
        return logits


def load_edge_categories(path: Path, kit: Kit) -> TrainedEdgeCategories:
    """Read the model in a file of weights, as `load_module`.

    kit: the kit that it was trained on. Raises CheckpointError for a kit of another name, with other labels, or with
    types that dock in other ways.
    """
    space = CategorySpace(kit)
    expected = {"kind": "edge_categories", "kit": kit.name, **describe_space(space)}

    def build(config: EdgeCategoriesConfig, header: Mapping[str, Any]) -> EdgeCategoriesModel:
        return make_model(config, CategoryTables.of(space), header["cycles"])

    module, header = load_module(path, expected, EdgeCategoriesConfig, build)
    return TrainedEdgeCategories(module, space, header)
