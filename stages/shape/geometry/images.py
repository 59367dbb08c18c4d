"""Compiled kernels on poses as points (`pose_vectors`): which of many images are distinct, and which is nearest."""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.geometry.grid_hash import OWN_CELL, cell_hash


@numba.njit(cache=True)
def _gap(one, other):
    total = 0.0
    for k in range(len(one)):
        total += (one[k] - other[k]) ** 2
    return total**0.5


@numba.njit(cache=True)
def distinct_images(vectors, labels, tolerance, same):
    """Return the indices of the images that are kept, int64 (k,), in the order of their labels.

    vectors: images as `pose_vectors`, float64 (n, 12)
    labels: directed labels, int32 (n,), changed in place

    An image within `same` of a kept one is dropped. If the nearest kept one within `tolerance` is of the same docking,
    `label // 2`, an image gets its label, the lower one.
    """
    reach = 1.01 * max(tolerance, same)
    size = 1
    while size < 2 * len(vectors):
        size *= 2
    heads, following = np.full(size, -1), np.full(len(vectors), -1)
    kept = np.empty(len(vectors), dtype=np.int64)
    count = 0
    for candidate in np.argsort(labels, kind="mergesort"):
        vector = vectors[candidate]
        nearest, least, is_written = -1, np.inf, False
        for turn in range(27):
            place = heads[cell_hash(vector, turn, reach) & (size - 1)]
            while place >= 0 and not is_written:
                gap = _gap(vectors[kept[place]], vector)
                is_written = gap <= same
                if gap <= tolerance and (gap < least or (gap == least and place < nearest)):
                    nearest, least = place, gap
                place = following[place]
            if is_written:
                break
        if is_written:
            continue
        if nearest >= 0 and labels[kept[nearest]] // 2 == labels[candidate] // 2:
            labels[candidate] = labels[kept[nearest]]
        cell = cell_hash(vector, OWN_CELL, reach) & (size - 1)
        following[count] = heads[cell]
        heads[cell] = count
        kept[count] = candidate
        count += 1
    return kept[:count].copy()


@numba.njit(cache=True)
def nearest_image(known, vectors):
    """Return the index of the nearest of the images `known` (n, 12), n > 0, for each of the `vectors` (m, 12), and its
    gap.
    """
    places, gaps = np.empty(len(vectors), dtype=np.int64), np.empty(len(vectors))
    for number in range(len(vectors)):
        best, least = 0, np.inf
        for place in range(len(known)):
            total = 0.0
            for k in range(12):
                total += (known[place, k] - vectors[number, k]) ** 2
                if total >= least:
                    break
            if total < least:
                best, least = place, total
        places[number], gaps[number] = best, least**0.5
    return places, gaps
