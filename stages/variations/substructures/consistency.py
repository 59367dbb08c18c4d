"""Which regions along a motion can change places together: those with which every part between them has a neighbourhood
that the grammar admits (substructures §4.3.1).

A part that coincides with one of the other shape has the neighbours of the one or of the other where one region is
beside it, and both were seen. Between several it may have some of each, which was not.
"""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.geometry.contact_lookup import random_below
from stages.variations.kernels.membership import admitted

CHANGES = 24
"""So often a choice is changed at most until the grammar admits it."""


@numba.njit(cache=True)
def make_consistent(rng, kit, base, giver, types, giver_types, regions, image, chosen):
    """Change `chosen` bool (n + m,), by the numbers of regions, until every part that coincides has an admitted
    neighbourhood: of those around one that has none, one region at random changes its side. False where it stays so.

    types, giver_types: int16 (n,) and (m,), the meshes of the parts; regions and image are rows of `Moves`.
    """
    n, m = len(types), len(giver_types)
    near = np.empty(len(base.tails) + len(giver.tails), dtype=np.int64)
    beside = np.empty(len(near), dtype=np.int64)
    for _ in range(CHANGES):
        offset, around = random_below(rng, m), 0
        for step in range(m):
            y = (offset + step) % m
            if image[y] >= 0:
                around = _misfits(kit, base, giver, types, giver_types, regions, n, image[y], y, chosen, near, beside)
                if around > 0:
                    break
        if around == 0:
            return True
        changed = beside[random_below(rng, around)]
        chosen[changed] = not chosen[changed]
    return False


@numba.njit(cache=True)
def _misfits(kit, base, giver, types, giver_types, regions, n, x, y, chosen, near, beside):
    """How many regions are `beside` a part of the base that coincides with one of the giver, counted by its neighbours;
    0 where the grammar admits these. `near` is scratch."""
    count, around = 0, 0
    for d in range(base.starts[x], base.starts[x + 1]):
        other = base.tails[base.twins[d]]
        region = regions[other]
        if region >= 0:
            beside[around] = region
            around += 1
        if region < 0 or not chosen[region]:
            near[count] = types[other]
            count += 1
    for d in range(giver.starts[y], giver.starts[y + 1]):
        other = giver.tails[giver.twins[d]]
        region = regions[n + other]
        if region >= 0:
            beside[around] = region
            around += 1
            if chosen[region]:
                near[count] = giver_types[other]
                count += 1
    return 0 if around == 0 or admitted(kit, types[x], near, count) else around
