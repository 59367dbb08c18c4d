"""Captions of three lengths from the facts about a shape."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from stages.captions.facts import Fact, ShapeFacts, facts_of
from stages.captions.grammar import opening, sentence
from stages.captions.settings import CaptionLength

MAX_THINGS: Mapping[CaptionLength, int] = {"short": 2, "medium": 3, "long": 6}
"""Kinds of parts that the first sentence lists."""
MAX_SENTENCES: Mapping[CaptionLength, int] = {"short": 0, "medium": 2, "long": 10}
"""Sentences after the first."""
MAX_OF_KIND = {"above": 2, "touches": 2, "color": 3, "stack": 2, "row": 2, "circle": 1}
"""Sentences of a kind in one caption; of others there is one."""
IMPORTANCE = (
    *("not rooted", "unstable", "grid", "stands on", "equal", "ratio", "longer", "all color", "color", "stack", "row"),
    *("circle", "above", "height", "parts", "touches", "tilt", "mirror", "stable"),
)
"""Kinds of facts, those first that a medium caption states."""
SAY_THAT_IT_STANDS = {"stands on", "tilt"}
"""Kinds of facts after which a caption need not say that the shape stands."""
SHUFFLED_KINDS = 4
"""Among as many of the most important kinds, chance decides which a medium caption states."""


def captions(
    shape: ShapeFacts, noun: str, lengths: Sequence[CaptionLength], rng: np.random.Generator
) -> dict[str, str]:
    """Return a caption of each length. Their facts hold for the shape; which of them and how is decided by `rng`."""
    facts = facts_of(shape)
    return {length: _caption(facts, noun, length, rng) for length in lengths}


def _caption(facts: Sequence[Fact], noun: str, length: CaptionLength, rng: np.random.Generator) -> str:
    grids = {fact.about[1]: fact for fact in facts if fact.kind == "grid"}
    counts = [fact for fact in facts if fact.kind == "count"]
    arranged = sorted(counts, key=lambda fact: fact.about[1] not in grids)
    things = [grids.get(fact.about[1], fact) for fact in arranged[: MAX_THINGS[length]]]
    adjectives = [fact.about[0] for fact in facts if fact.kind == "adjective"]
    first = opening(noun, adjectives[0] if adjectives else "", things, rng)
    stated = {(fact.kind, *fact.about) for fact in things}
    left = [fact for fact in facts if fact.kind in IMPORTANCE and (fact.kind, *fact.about) not in stated]
    chosen = _chosen(left, MAX_SENTENCES[length], rng)
    return " ".join([first, *(sentence(fact, rng) for fact in chosen)])


def _chosen(facts: Sequence[Fact], count: int, rng: np.random.Generator) -> list[Fact]:
    """Return up to `count` facts, the most important kinds first, but for some of them in an order by chance.

    That a shape stands by itself is left out after facts that say more.
    """
    kinds = sorted({fact.kind for fact in facts}, key=IMPORTANCE.index)
    shuffled = [kinds[index] for index in rng.permutation(min(SHUFFLED_KINDS, len(kinds))).tolist()]
    chosen: list[Fact] = []
    for kind in [*shuffled, *kinds[len(shuffled) :]]:
        chosen += [fact for fact in facts if fact.kind == kind][: MAX_OF_KIND.get(kind, 1)]
    kept = chosen[:count]
    stands = any(fact.kind in SAY_THAT_IT_STANDS for fact in kept)
    return [fact for fact in kept if not (stands and fact.kind == "stable")]
