"""Compiled kernels on poses as points (`pose_vectors`): which of many images are distinct, and which is nearest."""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.geometry.hash_tables import OWN_CELL, cell_hash
from stages.shape.geometry.sorting import sort_order


@numba.njit(cache=True)
def _gap(first, second):
    total = 0.0
    for k in range(len(first)):
        total += (first[k] - second[k]) ** 2
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
    for candidate in sort_order(labels):
        vector = vectors[candidate]
        nearest, least_gap, is_written = -1, np.inf, False
        for turn in range(27):
            index = heads[cell_hash(vector, turn, reach) & (size - 1)]
            while index >= 0 and not is_written:
                gap = _gap(vectors[kept[index]], vector)
                is_written = gap <= same
                if gap <= tolerance and (gap < least_gap or (gap == least_gap and index < nearest)):
                    nearest, least_gap = index, gap
                index = following[index]
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
    indices, gaps = np.empty(len(vectors), dtype=np.int64), np.empty(len(vectors))
    for number in range(len(vectors)):
        best, least_gap = 0, np.inf
        for index in range(len(known)):
            total = 0.0
            for k in range(12):
                total += (known[index, k] - vectors[number, k]) ** 2
                if total >= least_gap:
                    break
            if total < least_gap:
                best, least_gap = index, total
        indices[number], gaps[number] = best, least_gap**0.5
    return indices, gaps
