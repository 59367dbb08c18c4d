"""Keys of a shape graph by colour refinement."""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.geometry.hash_tables import mix
from stages.shape.geometry.sorting import sort_values
from stages.variations.kernels.structs import N_EDGES, N_PARTS


@numba.njit(cache=True)
def graph_key(label_of, ws, with_labels):
    """Return a hash of the variant's graph by colour refinement, coloured by `label_of`, without or with docking
    labels.

    Equal graphs have equal keys; different keys mean different graphs.
    """
    v, edges = ws.counts[N_PARTS], ws.counts[N_EDGES]
    for i in range(v):
        ws.colour[i] = mix(np.uint64(label_of[ws.types[i]]) + np.uint64(0x51ED270B))
    classes = 0
    ranked = np.empty(v, dtype=np.uint64)
    for _ in range(v):
        for i in range(v):
            ws.fresh[i] = mix(ws.colour[i])
        for e in range(edges):
            i, j = ws.edges[e, 0], ws.edges[e, 1]
            to_j = np.uint64(ws.label[i, j]) if with_labels else np.uint64(0)
            to_i = np.uint64(ws.label[j, i]) if with_labels else np.uint64(0)
            ws.fresh[i] += mix(ws.colour[j] + to_j * np.uint64(0x9E3779B97F4A7C15) + np.uint64(0x7F4A7C15))
            ws.fresh[j] += mix(ws.colour[i] + to_i * np.uint64(0x9E3779B97F4A7C15) + np.uint64(0x7F4A7C15))
        for i in range(v):
            ws.colour[i] = ws.fresh[i]
            ranked[i] = ws.fresh[i]
        sort_values(ranked)
        classes_now = 1
        for i in range(1, v):
            if ranked[i] != ranked[i - 1]:
                classes_now += 1
        if classes_now == classes:
            break
        classes = classes_now
    total = np.uint64(v)
    for i in range(v):
        total += mix(ranked[i])
    return mix(total)
