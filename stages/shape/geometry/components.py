"""Connected components of undirected graphs."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import IntArray


def connected_components(count: int, pairs: np.ndarray) -> IntArray:
    """Return the component of each of `count` nodes, int32 (count,), numbered in the order of their first nodes.

    pairs: nodes that are connected, int (m, 2).
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components as components_of

    graph = coo_array((np.ones(len(pairs), dtype=bool), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    components: IntArray = components_of(graph, directed=False)[1]
    return components
