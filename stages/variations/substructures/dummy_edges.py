"""Dummy edges of the dual: how a boundary passes over what two graphs do not have in common (substructures §4.4).

The paper joins dual nodes at a distance of two. Where the outside of two pieces falls into several parts that agree,
the arc between them may have any length. So a boundary goes on here from any place along the contour of an unmatched
region: the distance is not limited, but the choice is. Of two places in a row the nearer one is taken; the farther one
is reached by another operation from there.
"""

from __future__ import annotations

import numba
import numpy as np

from stages.variations.substructures.growing_arrays import grown
from stages.variations.substructures.partial_symmetry import DEFECTS, ROWS


@numba.njit(cache=True)
def is_alike(graph, d, e):
    """Return whether the darts start from nodes of one type with equal numbers of docking sites."""
    v, w = graph.tails[d], graph.tails[e]
    starts = graph.starts
    return graph.types[v] == graph.types[w] and starts[v + 1] - starts[v] == starts[w + 1] - starts[w]


@numba.njit(cache=True)
def pass_over(graph, over):
    """Return the dummy edges that can continue the current symmetry, as `go_on` takes them, int64 (k, 4)."""
    passes = np.empty((64, 4), dtype=np.int64)
    count = 0
    for k in range(over.counts[DEFECTS]):
        d, e = over.defects[k]
        v, w = graph.tails[d], graph.tails[e]
        first, second = graph.starts[v + 1] - graph.starts[v], graph.starts[w + 1] - graph.starts[w]
        for place in range(1, max(first, second)):
            passes = grown(passes, count + 1)
            passes[count] = (d, e, 0 if first > second else 1, place)
            count += 1
    contour, other = np.empty(len(graph.tails), dtype=np.int64), np.empty(len(graph.tails), dtype=np.int64)
    for row in range(over.counts[ROWS]):
        x, y = over.rows[row]
        if x < 0 or y < 0 or not _is_hole(graph, x, over.image) or not _is_hole(graph, y, over.image):
            continue
        for step in (1, -1):
            first = _contour(graph, x, step, over.image, contour)
            nearest = _contour(graph, y, step, over.image, other)
            for i in range(first):
                for j in range(0 if i > 0 else 1, nearest):
                    if is_alike(graph, contour[i], other[j]):
                        nearest = j
                        passes = grown(passes, count + 1)
                        passes[count] = (contour[i], other[j], -1, 0)
                        count += 1
                        break
    return passes[:count]


@numba.njit(cache=True)
def _is_hole(graph, dart, image):
    """Return whether a dart leads to an unmatched node."""
    return image[graph.tails[graph.twins[dart]]] < 0


@numba.njit(cache=True)
def _contour(graph, dart, step, image, out):
    """Write the darts that point back from unmatched nodes along the contour of the hole behind `dart`; return their
    number.

    step: 1 forwards, -1 backwards, until the hole ends
    """
    count, back = 0, graph.twins[dart]
    while True:
        out[count] = back
        count += 1
        start, end = graph.starts[graph.tails[back]], graph.starts[graph.tails[back] + 1]
        ahead = back + step
        ahead = start if ahead == end else end - 1 if ahead < start else ahead
        back = graph.twins[ahead]
        if image[graph.tails[back]] >= 0:
            return count
