"""Whether a grammar admits a neighbourhood, by its rule (strings §3); earlier verdicts are remembered.

It agrees with `stages.shape.graphs.neighbourhoods.admits`, without hubs, which no shape of the search has.
"""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.geometry.contact_lookup import UNKNOWN_CONTACT
from stages.shape.geometry.hash_tables import look_up, mix


@numba.njit(cache=True, inline="always")
def neighbourhood_key(kit, part_type):
    """Return the start of the key of a part's neighbourhood; the weights of its neighbours' types are added."""
    return mix(kit.weights[part_type])


@numba.njit(cache=True)
def recalled(rules, key):
    """Return 1 or 0 where the verdict of this key is known, else MISSING_KEY."""
    verdict = look_up(rules.keys, rules.verdicts, key)
    return 0 if verdict == UNKNOWN_CONTACT and rules.level == 0 else verdict


@numba.njit(cache=True)
def admitted(kit, part_type, near, count):
    """Return whether a part may have neighbours of the types near[:count]."""
    key = neighbourhood_key(kit, part_type)
    for n in range(count):
        key += kit.weights[near[n]]
    verdict = recalled(kit.rules, key)
    if verdict == UNKNOWN_CONTACT:
        labels = np.empty(count, dtype=np.int64)
        for n in range(count):
            labels[n] = kit.label_of[near[n]]
        verdict = _rule(kit.rules, kit.label_of[part_type], labels, count)
        _remember(kit.rules, key, verdict)
    return verdict == 1


@numba.njit(cache=True)
def _rule(rules, part_type, near, count):
    """Return the verdict of the rule, on labels."""
    if rules.level < 4 and (count >= rules.sizes.shape[1] or not rules.sizes[part_type, count]):
        return 0
    if rules.level == 1:
        key = mix(np.uint64(part_type) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(count))
        for n in range(count):
            first = True
            for m in range(n):
                if near[m] == near[n]:
                    first = False
                    break
            if first:
                key += rules.set_weights[near[n]]
        at = np.searchsorted(rules.sets, key)
        return 1 if at < len(rules.sets) and rules.sets[at] == key else 0
    around = 0
    for other in range(rules.local.shape[1]):
        if rules.local[part_type, other] >= 0:
            around += 1
    for n in range(count):
        row = rules.local[part_type, near[n]]
        if row < 0:
            return 0
        for m in range(n if rules.level == 2 else 0):
            column = rules.local[part_type, near[m]]
            if row != column and not rules.pairs[rules.pair_starts[part_type] + row * around + column]:
                return 0
    return 1


@numba.njit(cache=True)
def _remember(rules, key, verdict):
    """Keep a verdict while there is room; verdicts never change, so this changes no answer."""
    if 2 * rules.filled[0] >= len(rules.keys) or key == np.uint64(0):
        return
    mask = np.uint64(len(rules.keys) - 1)
    slot = key & mask
    while rules.keys[slot] != np.uint64(0):
        slot = (slot + np.uint64(1)) & mask
    rules.keys[slot] = key
    rules.verdicts[slot] = verdict
    rules.filled[0] += 1
