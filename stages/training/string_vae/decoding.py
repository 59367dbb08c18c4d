"""Decode latent points to strings, token by token; with a grammar mask, dead ends are left by backtracking."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from stages.strings.compiled_grammar import CompiledGrammar
from stages.training.string_vae.model import StringVae
from stages.training.string_vae.vocabulary import END_TOKEN

STRINGS_PER_BATCH = 256
MAX_DEAD_ENDS = 8
"""Dead ends before a string is finished without further cycles."""


@dataclass
class PartialString:
    """A string that is being decoded.

    kept: its tokens up to where it was cut.
    banned: tokens that must not follow there.
    acyclic: whether no further cycle may begin.
    dead_ends: number of dead ends.
    codes: its tokens.
    """

    kept: list[int] = field(default_factory=list)
    banned: set[int] = field(default_factory=set)
    acyclic: bool = False
    dead_ends: int = 0
    codes: list[int] = field(default_factory=list)

    def cut(self, numbers: int) -> None:
        """Backtrack from a dead end; tokens from `numbers` on are cycle numbers.

        The first time by one token, then twice as far each time, and the token there is banned, so that an early wrong
        choice is reached soon. The last time to where no cycle was open: from there the grammar has an acyclic way to
        the end, unless none of its strings is a tree.
        """
        self.dead_ends += 1
        if self.dead_ends == MAX_DEAD_ENDS:
            self.kept, self.banned, self.acyclic = self.codes[: self._last_acyclic(numbers)], set(), True
            return
        index = max(len(self.codes) - 2 ** (self.dead_ends - 1), 0)
        removed = set(self.codes[index : index + 1])
        self.banned = removed | (self.banned if index == len(self.kept) else set())
        self.kept = self.codes[:index]

    def _last_acyclic(self, numbers: int) -> int:
        """Return the length of the longest prefix without an open cycle."""
        open_cycles: set[int] = set()
        last = 0
        for index, code in enumerate(self.codes):
            if code >= numbers:
                open_cycles ^= {code}
            if not open_cycles:
                last = index + 1
        return last


@torch.no_grad()
def decode_codes(
    module: StringVae,
    points: npt.NDArray[np.float32],
    max_tokens: int,
    rules: CompiledGrammar | None,
    cycles: int,
    rng: np.random.Generator | None,
    temperature: float,
    partial: Sequence[PartialString] = (),
) -> list[list[int]]:
    """Decode latent points, float32 (n, latent), to token numbers: at most `max_tokens` a string, without an end.

    rules: only tokens that can still lead to a string of the grammar are taken; at a dead end the string backtracks, so
        that all results are strings of the grammar, if some of its strings are trees.
    rng: samples each token at a temperature; without it, the likeliest tokens are taken.
    partial: one string for each point to continue.
    """
    module.eval()
    strings: list[list[int]] = []
    for start in range(0, len(points), STRINGS_PER_BATCH):
        batch = torch.from_numpy(points[start : start + STRINGS_PER_BATCH])
        drafts = list(partial[start : start + STRINGS_PER_BATCH]) or [PartialString() for _ in range(len(batch))]
        waiting = list(range(len(drafts)))
        for _ in range(MAX_DEAD_ENDS + 1 if rules is not None else 1):
            ended = _decode(
                module, batch[waiting], [drafts[row] for row in waiting], max_tokens, rules, cycles, rng, temperature
            )
            waiting = [row for row, has_ended in zip(waiting, ended, strict=True) if not has_ended]
            if not waiting:
                break
            if rules is not None:
                for row in waiting:
                    drafts[row].cut(len(rules.counted) + 3)
        strings += [draft.codes for draft in drafts]
    return strings


def _decode(
    module: StringVae,
    points: Tensor,
    drafts: list[PartialString],
    max_tokens: int,
    rules: CompiledGrammar | None,
    cycles: int,
    rng: np.random.Generator | None,
    temperature: float,
) -> list[bool]:
    """Decode each string from where it was cut. Returns which have come to an end."""
    from stages.strings.grammar_mask import NO_TOKEN, GrammarMask

    device = next(module.parameters()).device
    points = points.to(device)
    mask = None if rules is None else GrammarMask(rules, cycles, len(drafts), max_tokens)
    state = module.start(points)
    before = torch.full((len(drafts),), END_TOKEN, device=device)
    ended, dead = np.zeros(len(drafts), np.bool_), np.zeros(len(drafts), np.bool_)
    for draft in drafts:
        draft.codes = []
    for index in range(max_tokens + 1):
        logits, state = module.step(before, points, state)
        scores = logits.double().cpu().numpy()
        if rng is not None:
            scores += temperature * rng.gumbel(size=scores.shape)
        if mask is None:
            tokens = scores.argmax(axis=1)
        else:
            kept = np.full(len(drafts), NO_TOKEN)
            for row, draft in enumerate(drafts):
                if index < len(draft.kept):
                    kept[row] = draft.kept[index]
                    continue
                if index == len(draft.kept):
                    scores[row, list(draft.banned)] = -np.inf
                if draft.acyclic:
                    scores[row, scores.shape[1] - cycles :] = -np.inf
            tokens = mask.choose(scores, kept)
            dead |= (tokens == NO_TOKEN) & ~ended
        tokens[dead | ended] = END_TOKEN
        for row in np.flatnonzero(~dead & ~ended).tolist():
            if tokens[row] != END_TOKEN:
                drafts[row].codes.append(int(tokens[row]))
        ended |= (tokens == END_TOKEN) & ~dead
        if (ended | dead).all():
            break
        if mask is not None:
            mask.take(tokens)
        before = torch.from_numpy(tokens).to(device)
    return list(ended)
