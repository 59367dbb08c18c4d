"""Bounds of the graph edit distance of two shape graphs, from two assignments of their parts.

Adding, removing or retyping a part costs 1; adding or removing a contact costs 1. The distance itself is NP-hard; the
bounds take milliseconds for hundreds of parts.
"""

from __future__ import annotations

import math

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.kit import Assembly


def edit_bounds(first: Assembly, second: Assembly) -> tuple[int, int]:
    """Return a lower and an upper bound of the graph edit distance of two assemblies of one kit.

    Lower bound: the cheapest assignment of parts, where a pair costs 1 if the types differ, plus half the difference of
    the degrees, since each edit of a contact concerns two parts. Upper bound: the cost of the edits of the cheapest
    assignment, where a pair also costs half the difference of its neighbour types.
    """
    types = 1 + int(max(first.types.max(), second.types.max()))
    around_first, around_second = _neighbour_counts(first, types), _neighbour_counts(second, types)
    degrees_first, degrees_second = around_first.sum(axis=1), around_second.sum(axis=1)
    differ = (first.types[:, None] != second.types[None, :]).astype(np.float64)
    gaps = np.abs(degrees_first[:, None] - degrees_second[None, :])
    _, below = _assign(differ + gaps / 2, 1 + degrees_first / 2, 1 + degrees_second / 2)
    common = np.zeros_like(differ)
    for part_type in range(types):
        common += np.minimum(around_first[:, None, part_type], around_second[None, :, part_type])
    apart = np.maximum(degrees_first[:, None], degrees_second[None, :]) - common
    images, _ = _assign(differ + apart / 2, 1 + degrees_first / 2, 1 + degrees_second / 2)
    # Costs are halves of whole numbers; rounding errors must not lift the bound.
    return math.ceil(below - 1e-6), _path_cost(first, second, images)


def _neighbour_counts(assembly: Assembly, types: int) -> FloatArray:
    counts = np.zeros((len(assembly), types))
    i, j = assembly.edges.T
    np.add.at(counts, (i, assembly.types[j]), 1)
    np.add.at(counts, (j, assembly.types[i]), 1)
    return counts


def _assign(change: FloatArray, remove: FloatArray, add: FloatArray) -> tuple[np.ndarray, float]:
    """Return the image of each part of the first shape, int64 (n,), -1 where it is removed, and the cheapest cost.

    A change never costs more than a removal and an addition, so the assignment changes all parts that it can.
    """
    from scipy.optimize import linear_sum_assignment

    rows, columns = change.shape
    size = max(rows, columns)
    costs = np.zeros((size, size))
    costs[:rows, :columns] = change
    costs[:rows, columns:] = remove[:, None]
    costs[rows:, :columns] = add[None, :]
    chosen, images = linear_sum_assignment(costs)
    return np.where(images[:rows] < columns, images[:rows], -1), float(costs[chosen, images].sum())


def _path_cost(first: Assembly, second: Assembly, images: np.ndarray) -> int:
    """Return the cost of turning the first shape graph into the second, where parts go to `images`."""
    kept = images >= 0
    cost = int((first.types[kept] != second.types[images[kept]]).sum())
    cost += len(first) + len(second) - 2 * int(kept.sum())
    moved = images[first.edges]
    lasting = {tuple(sorted(edge)) for edge in moved[(moved >= 0).all(axis=1)].tolist()}
    common = len(lasting & set(map(tuple, second.edges.tolist())))
    return cost + len(first.edges) + len(second.edges) - 2 * common
