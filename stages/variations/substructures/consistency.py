"""Which regions along an alignment can be swapped together: those that leave every part between them with a
neighbourhood that the grammar admits (substructures §4.3.1).

A part that coincides with one of the other shape has the neighbours of one or the other where one region is next to it,
and both were seen. Between several regions it may have some of each, which was not seen.
"""

from __future__ import annotations

import numba
import numpy as np

from stages.variations.kernels.membership import admitted
from stages.variations.kernels.random_choice import random_below

MAX_CHANGES = 24


@numba.njit(cache=True)
def make_consistent(rng, kit, base, giver, types, giver_types, regions, image, chosen):
    """Change `chosen` bool (n + m,), regions by number, until every coinciding part has an admitted neighbourhood.

    Of the regions around a part without one, a random region changes its side. Returns False where that fails.
    types, giver_types: int16 (n,) and (m,), meshes of the parts
    regions, image: rows of `RegionSwaps`
    """
    n, m = len(types), len(giver_types)
    near = np.empty(len(base.tails) + len(giver.tails), dtype=np.int64)
    adjacent = np.empty(len(near), dtype=np.int64)
    for _ in range(MAX_CHANGES):
        offset, around = random_below(rng, m), 0
        for step in range(m):
            y = (offset + step) % m
            if image[y] >= 0:
                around = _misfits(kit, base, giver, types, giver_types, regions, n, image[y], y, chosen, near, adjacent)
                if around > 0:
                    break
        if around == 0:
            return True
        changed = adjacent[random_below(rng, around)]
        chosen[changed] = not chosen[changed]
    return False


@numba.njit(cache=True)
def _misfits(kit, base, giver, types, giver_types, regions, n, x, y, chosen, near, adjacent):
    """Return the number of regions next to a part of the base that coincides, or 0 where the grammar admits its
    neighbours.

    They are written to `adjacent`; `near` is scratch.
    """
    count, around = 0, 0
    for d in range(base.starts[x], base.starts[x + 1]):
        other = base.tails[base.twins[d]]
        region = regions[other]
        if region >= 0:
            adjacent[around] = region
            around += 1
        if region < 0 or not chosen[region]:
            near[count] = types[other]
            count += 1
    for d in range(giver.starts[y], giver.starts[y + 1]):
        other = giver.tails[giver.twins[d]]
        region = regions[n + other]
        if region >= 0:
            adjacent[around] = region
            around += 1
            if chosen[region]:
                near[count] = giver_types[other]
                count += 1
    return 0 if around == 0 or admitted(kit, types[x], near, count) else around
