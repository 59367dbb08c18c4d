"""The key of an operation's result, from the graphs alone: known results need not be built (substructures §4.3.1)."""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.geometry.hash_tables import mix

GOLDEN_MULTIPLIER, ODD_OFFSET = np.uint64(0x9E3779B97F4A7C15), np.uint64(0x7F4A7C15)
TYPE_OFFSET = np.uint64(0x51ED270B)


@numba.njit(cache=True)
def result_key(base, giver, taken, piece, boundary):
    """Return the key of the result by colour refinement of its graph with docking labels, uint64.

    `graph_key` gives the shape the same key if it has no contacts beyond those that are brought along.
    taken: bool (a.n,), leaves the base
    piece: bool (b.n,), comes from the giver
    boundary: int64 (b, 2)
    """
    stays = len(base.types)
    place, outer = np.full(stays + len(giver.types), -1, dtype=np.int64), np.full(len(base.tails), -1, dtype=np.int64)
    source, is_wall = np.full(len(giver.tails), -1, dtype=np.int64), np.zeros(len(base.tails), dtype=np.bool_)
    for d, e in boundary:
        if d >= 0:
            is_wall[d] = True
        if d >= 0 and e >= 0:
            outer[d] = e
            source[e] = d
    count = 0
    for node in range(len(place)):
        if not taken[node] if node < stays else piece[node - stays]:
            place[node] = count
            count += 1
    edges, labels = (
        np.empty((len(base.tails) + len(giver.tails), 2), dtype=np.int64),
        np.empty(len(base.tails) + len(giver.tails), dtype=np.uint64),
    )
    colours, filled = np.empty(count, dtype=np.uint64), 0
    for node in range(len(place)):
        if place[node] < 0:
            continue
        graph, own = (base, node) if node < stays else (giver, node - stays)
        colours[place[node]] = mix(np.uint64(graph.types[own]) + TYPE_OFFSET)
        for dart in range(graph.starts[own], graph.starts[own + 1]):
            end, label = np.int64(-1), graph.labels[dart]
            if node >= stays:
                end = _beyond(base, giver, dart, place, source)
            elif outer[dart] >= 0:
                end, label = _beyond(base, giver, outer[dart], place, source), giver.labels[outer[dart]]
            elif not is_wall[dart] and not is_wall[base.twins[dart]]:
                end = place[base.tails[base.twins[dart]]]
            if end >= 0:
                edges[filled, 0], edges[filled, 1], labels[filled] = place[node], end, np.uint64(label - 1)
                filled += 1
    return refined(colours, edges[:filled], labels)


@numba.njit(cache=True)
def _beyond(base, giver, dart, place, source):
    """Return the node of the result that the giver's dart leads to, or -1."""
    ahead = giver.twins[dart]
    own = place[len(base.types) + giver.tails[ahead]]
    if own >= 0:
        return own
    return place[base.tails[source[ahead]]] if source[ahead] >= 0 else np.int64(-1)


@numba.njit(cache=True)
def swap_key(base, giver, taken, piece, image):
    """Return the same key for a region swap.

    Parts of the giver that coincide with one of the base, as `image` int16 (m,) says, bring their edges to the piece
    along.
    """
    n = len(base.types)
    place, count = np.full(n + len(giver.types), -1, dtype=np.int64), 0
    for node in range(len(place)):
        if not taken[node] if node < n else piece[node - n]:
            place[node] = count
            count += 1
    max_edges = len(base.tails) + 2 * len(giver.tails)
    edges, labels = np.empty((max_edges, 2), dtype=np.int64), np.empty(max_edges, dtype=np.uint64)
    colours, filled = np.empty(count, dtype=np.uint64), 0
    for node in range(len(place)):
        if place[node] >= 0:
            kind = base.types[node] if node < n else giver.types[node - n]
            colours[place[node]] = mix(np.uint64(kind) + TYPE_OFFSET)
    for d in range(len(base.tails)):
        i, j = place[base.tails[d]], place[base.tails[base.twins[d]]]
        if i >= 0 and j >= 0:
            edges[filled, 0], edges[filled, 1], labels[filled] = i, j, np.uint64(base.labels[d] - 1)
            filled += 1
    for d in range(len(giver.tails)):
        tail, head = giver.tails[d], giver.tails[giver.twins[d]]
        i = place[n + tail] if piece[tail] else place[image[tail]] if image[tail] >= 0 else -1
        j = place[n + head] if piece[head] else place[image[head]] if image[head] >= 0 else -1
        if i >= 0 and j >= 0 and (piece[tail] or piece[head]):
            edges[filled, 0], edges[filled, 1], labels[filled] = i, j, np.uint64(giver.labels[d] - 1)
            filled += 1
    return refined(colours, edges[:filled], labels)


@numba.njit(cache=True)
def refined(colours, edges, labels):
    """Return the hash of a graph by colour refinement, as `graph_key` does, from its edges in both directions."""
    classes = 0
    for _ in range(len(colours)):
        fresh = np.empty_like(colours)
        for i in range(len(colours)):
            fresh[i] = mix(colours[i])
        for k in range(len(edges)):
            fresh[edges[k, 0]] += mix(colours[edges[k, 1]] + labels[k] * GOLDEN_MULTIPLIER + ODD_OFFSET)
        colours = fresh
        ranked = np.sort(colours)
        classes_now = 1
        for i in range(1, len(ranked)):
            if ranked[i] != ranked[i - 1]:
                classes_now += 1
        if classes_now == classes:
            break
        classes = classes_now
    total = np.uint64(len(colours))
    for i in range(len(colours)):
        total += mix(colours[i])
    return mix(total)
