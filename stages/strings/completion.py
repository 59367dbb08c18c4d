"""The tokens that complete a node of a string, by the compiled tiling grammar (strings §3).

Numba compiles this module when it is imported: import it inside functions.
"""

from __future__ import annotations

import numba
import numpy as np

NO_COMPLETION = 1 << 28
"""Tokens to complete a node that cannot be completed."""


@numba.njit(cache=True)
def tokens_to_complete(grammar, kind, counts, pending, finished):
    """Return the fewest tokens of the children that a node still needs, with parentheses, or NO_COMPLETION.

    counts: int16 (types,), its neighbours by type; pending: its open cycles; finished: it gets no more children.
    """
    best = NO_COMPLETION
    types = len(counts)
    for p in range(grammar.first[kind], grammar.first[kind + 1]):
        total, missing = 0, np.int64(0)
        fits = True
        for t in range(types):
            if counts[t] > grammar.high[p, t]:
                fits = False
                break
            if grammar.counted[t]:
                total += counts[t]
            if counts[t] < grammar.low[p, t]:
                missing += grammar.low[p, t] - counts[t]
        if not fits:
            continue
        limited = grammar.size[p] >= 0
        room = grammar.size[p] - total if limited else missing + pending
        if missing > room:
            continue
        if grammar.partial:
            if pending <= room or grammar.loose[p]:
                return 0
            continue
        if finished:
            if missing <= pending and (not limited or room == pending or (room < pending and grammar.loose[p])):
                return 0
            continue
        if room < pending and not grammar.loose[p]:
            continue
        best = min(best, _cheapest(grammar, p, kind, counts, missing, room if limited else missing, pending))
    return best


@numba.njit(cache=True)
def _cheapest(grammar, p, kind, counts, missing, room, pending):
    """Return the tokens of children that fill `room` slots of pattern p, the `pending` costliest filled by cycles."""
    children = max(room - pending, 0)
    if children == 0:
        return 0
    fill = NO_COMPLETION
    for t in range(len(counts)):
        if counts[t] < grammar.high[p, t] and grammar.counted[t]:
            fill = min(fill, grammar.cost[kind, t])
    total = fill * (room - missing) if room > missing else 0
    saved = 0
    for t in range(len(counts)):
        if counts[t] < grammar.low[p, t]:
            total += grammar.cost[kind, t] * (grammar.low[p, t] - counts[t])
    if pending > 0:
        open_slots = pending
        last = NO_COMPLETION + 1
        while open_slots > 0:  # the costliest first
            costliest, number = -1, 0
            if room > missing and fill < last:
                costliest, number = fill, room - missing
            for t in range(len(counts)):
                if counts[t] < grammar.low[p, t]:
                    cost = grammar.cost[kind, t]
                    if cost < last:
                        if cost > costliest:
                            costliest, number = cost, grammar.low[p, t] - counts[t]
                        elif cost == costliest:
                            number += grammar.low[p, t] - counts[t]
            if costliest < 0:
                break
            filled = min(open_slots, number)
            saved += filled * costliest
            open_slots -= filled
            last = costliest
    return min(total - saved + 2 * (children - 1), NO_COMPLETION)
