"""Strings of which no shape can come, written anew from where they went wrong: beyond strings §6.

A mask knows the grammar, but not space: of shapes of a hundred parts most strings that it admits have a cycle which
closes at the wrong part, and then no arrangement is left. Which token was the first that no arrangement allows is found
by halves; there the model takes another.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stages.string_sampling.instantiation.instantiate import Instantiator
from stages.string_sampling.instantiation.state import SolverMethod
from stages.strings.decoder import Decoded, decode
from stages.training.string_vae.decoding import PartialString
from stages.training.string_vae.latent_sampling import LatentSearchResult
from stages.training.string_vae.trained import TrainedStringVae

MAX_PROBE_PLACEMENTS = 2000
"""Parts that are put down at most to learn whether an arrangement is left: most that have none are told by less."""


def repair_strings(
    model: TrainedStringVae,
    found: Sequence[LatentSearchResult],
    maker: Instantiator,
    method: SolverMethod,
    times: int,
    seed: int,
) -> list[str | None]:
    """The strings of what was found, each written anew at most `times` while no arrangement of its graph is left.

    What is written anew takes the likeliest tokens. A string that goes wrong no farther than before goes back twice as
    far each time. Those of a decoder without a mask stay as they are.
    """
    strings = [each.string for each in found]
    if not model.is_masked:
        return strings
    wrong = [number for number, each in enumerate(strings) if each is not None]
    farthest, stuck = [-1] * len(found), [0] * len(found)
    drafts = {number: PartialString() for number in wrong}
    for _ in range(times):
        still = []
        for number in wrong:
            string = strings[number]
            assert string is not None
            codes, before = model.vocabulary.codes(string).tolist(), drafts[number]
            possible = len(before.kept) if codes[: len(before.kept)] == before.kept else 0  # less after a dead end
            place = first_impossible_token(maker, decode(string, model.vocabulary.alphabet), method, seed, possible)
            if place is None:
                continue
            stuck[number] = stuck[number] + 1 if place <= farthest[number] else 0
            farthest[number] = max(place, farthest[number])
            cut = max(place - 2 ** stuck[number] + 1, 0)
            banned = before.banned if codes[:cut] == before.kept else set()
            drafts[number] = PartialString(codes[:cut], banned | {codes[cut]})
            still.append(number)
        wrong = still
        if not wrong:
            break
        begun = [PartialString(drafts[each].kept, set(drafts[each].banned)) for each in wrong]
        points = np.stack([found[each].point for each in wrong])
        for number, string in zip(wrong, model.decode(points, None, partial=begun), strict=True):
            strings[number] = string
    return strings


def first_impossible_token(
    maker: Instantiator, graph: Decoded, method: SolverMethod, seed: int, possible: int = 0
) -> int | None:
    """The place of the first token of a string after which no beginning of a shape is left; of one of which nothing
    comes but for its end, the last. None where a shape comes of it, or where TRIED parts do not tell. With the first
    `possible` tokens something is known to be left.
    """
    node_places = np.array([place for place, each in enumerate(graph.tokens) if each.kind == "node"])
    edge_places = np.zeros(len(graph.edges), np.int64)
    for place, token in enumerate(graph.tokens):
        if token.edge >= 0:
            edge_places[token.edge] = place  # of a cycle the later number
    brief = method._replace(budget=min(method.budget, MAX_PROBE_PLACEMENTS))

    def is_impossible(tokens: int, method: SolverMethod) -> bool:
        types, edges = graph.types[: (node_places < tokens).sum()], graph.edges[edge_places < tokens]
        return maker.instantiate(types, edges, np.random.default_rng(seed), method).is_impossible

    low, high = possible, len(graph.texts)
    if not is_impossible(high, brief):
        return None
    begun = brief._replace(whole=False, ended=False)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if is_impossible(middle, begun) else (middle, high)
    return high - 1
