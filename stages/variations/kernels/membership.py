"""Whether a grammar admits a neighbourhood, by its patterns (strings §3); earlier verdicts are remembered.

Shapes of the search have no hubs.
"""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.geometry.contact_lookup import UNKNOWN_CONTACT
from stages.shape.geometry.hash_tables import look_up, mix
from stages.shape.graphs.grammar_patterns import fits


@numba.njit(cache=True, inline="always")
def neighbourhood_key(kit, part_type):
    """Return the start of the key of a part's neighbourhood; the weights of its neighbours' types are added."""
    return mix(kit.weights[part_type])


@numba.njit(cache=True)
def recalled(rules, key):
    """Return 1 or 0 where the verdict of this key is known, else MISSING_KEY."""
    verdict = look_up(rules.keys, rules.verdicts, key)
    return 0 if verdict == UNKNOWN_CONTACT and rules.is_exact else verdict


@numba.njit(cache=True)
def admitted(kit, part_type, near, count):
    """Return whether a part may have neighbours of the types near[:count]."""
    key = neighbourhood_key(kit, part_type)
    for n in range(count):
        key += kit.weights[near[n]]
    verdict = recalled(kit.rules, key)
    if verdict == UNKNOWN_CONTACT:
        counts = np.zeros(len(kit.rules.patterns.counted), dtype=np.int64)
        for n in range(count):
            counts[kit.label_of[near[n]]] += 1
        verdict = 1 if fits(kit.rules.patterns, kit.label_of[part_type], counts, True) else 0
        _remember(kit.rules, key, verdict)
    return verdict == 1


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
