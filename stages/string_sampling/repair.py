"""Repair of strings that no arrangement of parts realizes, beyond strings §6.

The grammar mask knows no geometry: for shapes of a hundred parts, most admitted strings have a cycle that closes at the
wrong part. Bisection finds the first token that makes a string impossible, and the model decodes another one there.
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
"""To find out whether a prefix is impossible; fewer suffice for most that are."""


def repair_strings(
    model: TrainedStringVae,
    results: Sequence[LatentSearchResult],
    instantiator: Instantiator,
    method: SolverMethod,
    max_repairs: int,
    seed: int,
) -> list[str | None]:
    """Return the strings of search results, each repaired at most `max_repairs` times.

    The likeliest tokens are decoded after a cut. A string that fails no farther than before is cut twice as far
    back each time. Strings of a decoder without a mask stay as they are.
    """
    strings = [result.string for result in results]
    if not model.is_masked:
        return strings
    wrong = [number for number, string in enumerate(strings) if string is not None]
    farthest, stuck = [-1] * len(results), [0] * len(results)
    drafts = {number: PartialString() for number in wrong}
    for _ in range(max_repairs):
        still = []
        for number in wrong:
            string = strings[number]
            assert string is not None
            codes, before = model.vocabulary.codes(string).tolist(), drafts[number]
            possible = len(before.kept) if codes[: len(before.kept)] == before.kept else 0  # less after a dead end
            index = first_impossible_token(
                instantiator, decode(string, model.vocabulary.alphabet), method, seed, possible
            )
            if index is None:
                continue
            stuck[number] = stuck[number] + 1 if index <= farthest[number] else 0
            farthest[number] = max(index, farthest[number])
            cut = max(index - 2 ** stuck[number] + 1, 0)
            banned = before.banned if codes[:cut] == before.kept else set()
            drafts[number] = PartialString(codes[:cut], banned | {codes[cut]})
            still.append(number)
        wrong = still
        if not wrong:
            break
        partial = [PartialString(drafts[number].kept, set(drafts[number].banned)) for number in wrong]
        points = np.stack([results[number].point for number in wrong])
        for number, string in zip(wrong, model.decode(points, None, partial=partial), strict=True):
            strings[number] = string
    return strings


def first_impossible_token(
    instantiator: Instantiator, graph: Decoded, method: SolverMethod, seed: int, possible: int = 0
) -> int | None:
    """Return the index of the first token that makes a string impossible.

    It is the last one if only the end of the string does. None if the string has an arrangement, or if
    MAX_PROBE_PLACEMENTS do not tell. The first `possible` tokens are known to be possible.
    """
    node_tokens = np.array([index for index, token in enumerate(graph.tokens) if token.kind == "node"])
    edge_tokens = np.zeros(len(graph.edges), np.int64)
    for index, token in enumerate(graph.tokens):
        if token.edge >= 0:
            edge_tokens[token.edge] = index  # of a cycle the later number
    brief = method._replace(budget=min(method.budget, MAX_PROBE_PLACEMENTS))

    def is_impossible(tokens: int, method: SolverMethod) -> bool:
        types, edges = graph.types[: (node_tokens < tokens).sum()], graph.edges[edge_tokens < tokens]
        return instantiator.instantiate(types, edges, np.random.default_rng(seed), method).is_impossible

    low, high = possible, len(graph.texts)
    if not is_impossible(high, brief):
        return None
    of_prefix = brief._replace(whole=False, ended=False)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if is_impossible(middle, of_prefix) else (middle, high)
    return high - 1
