"""The graph of the variant that is being made: boxes around its parts, and its edges."""

from __future__ import annotations

import numba

from stages.variations.kernels.structs import N_EDGES, TRY_NUMBER


@numba.njit(cache=True)
def inherit_edges(starts, ends, labels, index, ws):
    """Add the edges of a shape between parts that are in the variant; `index` gives their numbers there, or -1."""
    for part in range(len(starts) - 1):
        i = index[part]
        if i < 0:
            continue
        for e in range(starts[part], starts[part + 1]):
            end = ends[e]
            j = index[end]
            if j >= 0 and part < end:
                back = -1
                for f in range(starts[end], starts[end + 1]):
                    if ends[f] == part:
                        back = labels[f]
                        break
                set_edge(ws.stamp, ws.label, ws.edges, ws.counts, i, j, labels[e], back)


@numba.njit(cache=True)
def set_edge(stamp, label, edges, counts, i, j, label_ij, label_ji):
    """Add an edge of the variant, or only its labels where it exists."""
    if stamp[i, j] != counts[TRY_NUMBER]:
        stamp[i, j] = counts[TRY_NUMBER]
        stamp[j, i] = counts[TRY_NUMBER]
        edges[counts[N_EDGES], 0] = i
        edges[counts[N_EDGES], 1] = j
        counts[N_EDGES] += 1
    label[i, j] = label_ij
    label[j, i] = label_ji


@numba.njit(cache=True)
def place_boxes(type_boxes, types, rotations, translations, count, boxes):
    """Write the axis-aligned boxes around the parts, as centre and half extents."""
    for v in range(count):
        for i in range(3):
            centre, half = translations[v, i], 0.0
            for j in range(3):
                centre += rotations[v, i, j] * type_boxes[types[v], 0, j]
                half += abs(rotations[v, i, j]) * type_boxes[types[v], 1, j]
            boxes[v, 0, i] = centre
            boxes[v, 1, i] = half
