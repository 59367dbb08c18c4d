"""Points of the latent space to strings, token by token; where a mask says what may come, with ways back."""

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
"""Strings that are written side by side."""
MAX_DEAD_ENDS = 8
"""After so many dead ends a string is ended without further cycles."""


@dataclass
class PartialString:
    """One string on its way. kept: its tokens up to where it was cut; banned: tokens that must not come next there;
    acyclic: whether no cycle may begin any more; ends: dead ends so far."""

    kept: list[int] = field(default_factory=list)
    banned: set[int] = field(default_factory=set)
    acyclic: bool = False
    ends: int = 0
    codes: list[int] = field(default_factory=list)

    def cut(self, numbers: int) -> None:
        """Go back from a dead end; tokens from `numbers` on are cycle numbers.

        One token the first time, twice as far each time after, and what stood there is banned there: so a choice that
        was wrong far before is reached soon. In the end to where no cycle was open: from there the grammar has a way to
        the end that opens none, unless none of its strings is a tree.
        """
        self.ends += 1
        if self.ends == MAX_DEAD_ENDS:
            self.kept, self.banned, self.acyclic = self.codes[: self._last_acyclic(numbers)], set(), True
            return
        place = max(len(self.codes) - 2 ** (self.ends - 1), 0)
        stood = set(self.codes[place : place + 1])
        self.banned = stood | (self.banned if place == len(self.kept) else set())
        self.kept = self.codes[:place]

    def _last_acyclic(self, numbers: int) -> int:
        """How many of the tokens can be kept so that no cycle is open."""
        opened: set[int] = set()
        last = 0
        for place, code in enumerate(self.codes):
            if code >= numbers:
                opened ^= {code}
            if not opened:
                last = place + 1
        return last


@torch.no_grad()
def decode_codes(
    module: StringVae,
    points: npt.NDArray[np.float32],
    most: int,
    rules: CompiledGrammar | None,
    cycles: int,
    rng: np.random.Generator | None,
    temperature: float,
    begun: Sequence[PartialString] = (),
) -> list[list[int]]:
    """The tokens of a string for each point, float32 (n, latent), at most `most`, without an end.

    Each token is drawn by its probability, at a temperature, or, without an `rng`, is the likeliest. With `rules`, only
    tokens that can still lead to a string of the grammar are taken; where none is left, the string goes back and on by
    another way, so that all are strings of the grammar, if some of its strings are trees. Strings that are `begun`, one
    for each point, go on from there.
    """
    module.eval()
    found: list[list[int]] = []
    for start in range(0, len(points), STRINGS_PER_BATCH):
        here = torch.from_numpy(points[start : start + STRINGS_PER_BATCH])
        drafts = list(begun[start : start + STRINGS_PER_BATCH]) or [PartialString() for _ in range(len(here))]
        waiting = list(range(len(drafts)))
        for _ in range(MAX_DEAD_ENDS + 1 if rules is not None else 1):
            ended = _write(
                module, here[waiting], [drafts[row] for row in waiting], most, rules, cycles, rng, temperature
            )
            waiting = [row for row, has_ended in zip(waiting, ended, strict=True) if not has_ended]
            if not waiting:
                break
            if rules is not None:
                for row in waiting:
                    drafts[row].cut(len(rules.counted) + 3)
        found += [draft.codes for draft in drafts]
    return found


def _write(
    module: StringVae,
    points: Tensor,
    drafts: list[PartialString],
    most: int,
    rules: CompiledGrammar | None,
    cycles: int,
    rng: np.random.Generator | None,
    temperature: float,
) -> list[bool]:
    """Write each draft on from where it was cut; which have come to an end."""
    from stages.strings.grammar_mask import NO_TOKEN, GrammarMask

    device = next(module.parameters()).device
    points = points.to(device)
    acceptor = None if rules is None else GrammarMask(rules, cycles, len(drafts), most)
    state = module.start(points)
    shown = torch.full((len(drafts),), END_TOKEN, device=device)
    ended, dead = np.zeros(len(drafts), np.bool_), np.zeros(len(drafts), np.bool_)
    for draft in drafts:
        draft.codes = []
    for place in range(most + 1):
        logits, state = module.step(shown, points, state)
        scores = logits.double().cpu().numpy()
        if rng is not None:
            scores += temperature * rng.gumbel(size=scores.shape)
        if acceptor is None:
            tokens = scores.argmax(axis=1)
        else:
            kept = np.full(len(drafts), NO_TOKEN)
            for row, draft in enumerate(drafts):
                if place < len(draft.kept):
                    kept[row] = draft.kept[place]
                    continue
                if place == len(draft.kept):
                    scores[row, list(draft.banned)] = -np.inf
                if draft.acyclic:
                    scores[row, scores.shape[1] - cycles :] = -np.inf
            tokens = acceptor.choose(scores, kept)
            dead |= (tokens == NO_TOKEN) & ~ended
        tokens[dead | ended] = END_TOKEN
        for row in np.flatnonzero(~dead & ~ended).tolist():
            if tokens[row] != END_TOKEN:
                drafts[row].codes.append(int(tokens[row]))
        ended |= (tokens == END_TOKEN) & ~dead
        if (ended | dead).all():
            break
        if acceptor is not None:
            acceptor.take(tokens)
        shown = torch.from_numpy(tokens).to(device)
    return list(ended)
