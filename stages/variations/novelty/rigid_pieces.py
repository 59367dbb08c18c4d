"""The largest pieces of a shape that one rigid transform lays on an exemplar, and a greedy cover of the shape by them.

A part p lies on a part q of an exemplar by symmetry s under the transform that lays pose(p) on pose(q) * s. The
transform is rigid, so each neighbour of p lies on at most one neighbour of q, by one symmetry. A piece is everything
that is reached so, and a triple (p, q, s) belongs to one piece only. Each contact is written as its docking and the
symmetries of both parts, pose = symmetry[near] * docking * symmetry[far]; all of this is then arithmetic in groups.
Symmetries are numbered within their type; the number after the last one means none.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from stages.shape.geometry.sorting import sort_order


class Groups(NamedTuple):
    """The symmetry groups of part types."""

    orders: np.ndarray  # int64 (types,): numbers of symmetries
    starts: np.ndarray  # int64 (types,): first symmetry of each type in the next three
    rotations: np.ndarray  # float64 (s, 3, 3)
    inverses: np.ndarray  # int64 (s,)
    signs: np.ndarray  # int64 (s,): -1 for reflections
    products: np.ndarray  # int64 (p,): product tables, one row and column longer than the order
    rows: np.ndarray  # int64 (types,): start of each type's table
    reach: np.ndarray  # float64 (types,): half diagonals


class Dockings(NamedTuple):
    """The directed dockings, by label."""

    ends: np.ndarray  # int64 (labels, 2): type it is seen from, type of the other part
    rotations: np.ndarray  # float64 (labels, 3, 3): one pose of the other part
    translations: np.ndarray  # float64 (labels, 3)
    passed: np.ndarray  # int64 (t,): symmetry of the other part that equals each symmetry of the first, or none
    rows: np.ndarray  # int64 (labels,): start of each label in `passed` and `place_numbers`
    kept: np.ndarray  # int64 (c,): symmetries of the first part with an equal one
    kept_starts: np.ndarray  # int64 (labels + 1,)
    place_numbers: np.ndarray  # int64 (t,): place of the other part among those around the first part's type
    place_counts: np.ndarray  # int64 (types,)
    tolerance: float  # of poses, in kit units


class Joints(NamedTuple):
    """The contacts of a shape, seen from both ends."""

    starts: np.ndarray  # int64 (n + 1,)
    ends: np.ndarray  # int64 (2 m,)
    labels: np.ndarray  # int64 (2 m,)
    near: np.ndarray  # int64 (2 m,): symmetry of the part it is seen from
    far: np.ndarray  # int64 (2 m,): symmetry of the other part


class Target(NamedTuple):
    """All exemplars as one shape."""

    rank: np.ndarray  # int64 (n,): number of a part among those of its type
    type_sizes: np.ndarray  # int64 (types,)
    handed: np.ndarray  # int64 (n,): -1 for mirrored parts
    owner: np.ndarray  # int64 (n,): exemplar of each part
    sizes: np.ndarray  # int64 (exemplars,)
    joints: Joints
    undo_near: np.ndarray  # int64 (2 m,): inverses of `joints.near`
    undo_far: np.ndarray  # int64 (2 m,): inverses of `joints.far`
    at: np.ndarray  # int32 (c,): joint to the part at each place around a part, or -1
    at_starts: np.ndarray  # int64 (n,)
    tails: np.ndarray  # int64 (2 m,): part that each joint is seen from
    by_label: np.ndarray  # int64 (2 m,): joints in order of their labels
    label_starts: np.ndarray  # int64 (labels + 1,)


@numba.njit(cache=True)
def locate(groups, dockings, shape):
    """Return the symmetries near and far, int64 (2 m,), by which each contact of a shape is an image of its docking."""
    near, far = np.zeros(len(shape.ends), dtype=np.int64), np.zeros(len(shape.ends), dtype=np.int64)
    place_here, turned, between = np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    place, pose = np.empty(3), np.empty((3, 3))
    # An image this close is unique: take it at once.
    plainly = (dockings.tolerance / 8) ** 2
    for part in range(len(shape.types)):
        for k in range(shape.starts[part], shape.starts[part + 1]):
            label, other = shape.labels[k], shape.ends[k]
            if label < 0:
                continue
            a, b = dockings.ends[label, 0], dockings.ends[label, 1]
            weight = groups.reach[b] ** 2
            for i in range(3):
                place[i] = 0.0
                for m in range(3):
                    place[i] += shape.rotations[part, m, i] * (
                        shape.translations[other, m] - shape.translations[part, m]
                    )
                for j in range(3):
                    pose[i, j] = 0.0
                    for m in range(3):
                        pose[i, j] += shape.rotations[part, m, i] * shape.rotations[other, m, j]
            best = np.inf
            for s in range(groups.orders[a]):
                if best <= plainly:
                    break
                symmetry = groups.rotations[groups.starts[a] + s]
                gap = 0.0
                for i in range(3):
                    place_here[i] = 0.0
                    for m in range(3):
                        place_here[i] += symmetry[i, m] * dockings.translations[label, m]
                    gap += (place_here[i] - place[i]) ** 2
                if gap >= best:
                    continue
                for i in range(3):
                    for j in range(3):
                        turned[i, j] = 0.0
                        for m in range(3):
                            turned[i, j] += symmetry[i, m] * dockings.rotations[label, m, j]
                for i in range(3):
                    for j in range(3):
                        between[i, j] = 0.0
                        for m in range(3):
                            between[i, j] += turned[m, i] * pose[m, j]
                for t in range(groups.orders[b]):
                    total = gap
                    for i in range(3):
                        for j in range(3):
                            total += weight * (between[i, j] - groups.rotations[groups.starts[b] + t, i, j]) ** 2
                        if total >= best:
                            break
                    if total < best:
                        best, near[k], far[k] = total, s, t
    return near, far


@numba.njit(cache=True)
def _product(products, row, order, first, second):
    """Return the number of the product of two symmetries of a type."""
    return products[row + first * (order + 1) + second]


@numba.njit(cache=True)
def _enter(visited, bit):
    """Mark a triple as visited; return whether it was new."""
    mask = np.uint64(1) << np.uint64(bit & 63)
    if visited[bit >> 6] & mask:
        return False
    visited[bit >> 6] |= mask
    return True


@numba.njit(cache=True)
def _rarest_first(joints, target):
    """Return the contacts of a shape, each once, int64 (k,), those with the docking rarest in the exemplars first."""
    chosen, times = np.empty(len(joints.ends), dtype=np.int64), np.empty(len(joints.ends), dtype=np.int64)
    count = 0
    for p in range(len(joints.starts) - 1):
        for k in range(joints.starts[p], joints.starts[p + 1]):
            label = joints.labels[k]
            if joints.ends[k] > p and label >= 0:
                chosen[count] = k
                times[count] = target.label_starts[label + 1] - target.label_starts[label]
                count += 1
    return chosen[sort_order(times[:count])]


@numba.njit(cache=True)
def _seeds(groups, dockings, types, handed, tails, joints, target, budget):
    """Return the ways to lay a contact of a shape on one of an exemplar, rarest dockings first, at most `budget`.

    Rows of int64 (k, 3) are triples (p, q, s): a part, the part that it lies on, and the symmetry.
    """
    orders, products, rows, signs, firsts = groups.orders, groups.products, groups.rows, groups.signs, groups.starts
    inverses, kept, kept_starts = groups.inverses, dockings.kept, dockings.kept_starts
    labels, near, their_near = joints.labels, joints.near, target.joints.near
    chosen, total = _rarest_first(joints, target), 0
    for k in chosen:
        label = labels[k]
        times = target.label_starts[label + 1] - target.label_starts[label]
        total += times * (kept_starts[label + 1] - kept_starts[label])
    seeds, count = np.empty((min(total, budget), 3), dtype=np.int64), 0
    for k in chosen:
        p, label = tails[k], labels[k]
        a = types[p]
        for at in range(target.label_starts[label], target.label_starts[label + 1]):
            t = target.by_label[at]
            q = target.tails[t]
            for c in range(kept_starts[label], kept_starts[label + 1]):
                s = _product(products, rows[a], orders[a], kept[c], inverses[firsts[a] + near[k]])
                s = _product(products, rows[a], orders[a], their_near[t], s)
                if s == orders[a] or handed[p] * target.handed[q] * signs[firsts[a] + s] < 0:
                    continue
                if count == len(seeds):
                    return seeds
                seeds[count, 0], seeds[count, 1], seeds[count, 2] = p, q, s
                count += 1
    return seeds[:count]


@numba.njit(cache=True)
def rigid_pieces(groups, dockings, types, handed, tails, joints, target, budget):
    """Return the largest connected pieces, of two parts and more, that one rigid transform lays on an exemplar.

    They grow breadth first from the rarest dockings until `budget` contacts have been looked at; no clock decides.
    types, handed, tails, joints: of the shape, as those of `target`
    Returns parts int64 (p,), starts int64 (k + 1,) of each piece in them, and the exemplar of each piece int64 (k,).
    """
    # Taking an array out of a tuple counts a reference, which in the loop would cost more than the work itself.
    orders, products, rows = groups.orders, groups.products, groups.rows
    passed, place_numbers, turns = dockings.passed, dockings.place_numbers, dockings.rows
    joint_starts, ends, labels, near, far = joints
    their_ends, standing, standing_starts = target.joints.ends, target.at, target.at_starts
    undo_near, undo_far, rank, owner = target.undo_near, target.undo_far, target.rank, target.owner
    n = len(types)
    spans = orders[types] * target.type_sizes[types]
    # A bit for each triple (p, q, s); q and s of the parts of the current piece; the last piece that a part was in.
    offsets, visited = spans.cumsum() - spans, np.zeros(spans.sum() // 64 + 1, dtype=np.uint64)
    on, by, piece_of = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64), np.full(n, -1, dtype=np.int64)
    parts, filled = np.empty(4 * n, dtype=np.int64), 0
    starts, owners, pieces = np.zeros(n + 1, dtype=np.int64), np.empty(n, dtype=np.int64), 0
    seeds = _seeds(groups, dockings, types, handed, tails, joints, target, budget)
    for seed in range(len(seeds)):
        p, q, s = seeds[seed, 0], seeds[seed, 1], seeds[seed, 2]
        if not _enter(visited, offsets[p] + rank[q] * orders[types[p]] + s):
            continue
        if budget < 0:
            break
        if filled + n > len(parts):
            parts = np.concatenate((parts, np.empty_like(parts)))
        if pieces == len(owners):
            starts = np.concatenate((starts, np.empty_like(owners)))
            owners = np.concatenate((owners, np.empty_like(owners)))
        parts[filled], on[0], by[0], piece_of[p] = p, q, s, pieces
        size, done = 1, 0
        while done < size:
            p, q, s = parts[filled + done], on[done], by[done]
            done += 1
            a = types[p]
            for k in range(joint_starts[p], joint_starts[p + 1]):
                other, label = ends[k], labels[k]
                if piece_of[other] == pieces or label < 0:
                    continue
                budget -= 1
                b = types[other]
                turned = _product(products, rows[a], orders[a], s, near[k])
                t = standing[standing_starts[q] + place_numbers[turns[label] + turned]]
                if t < 0:
                    continue
                over = passed[turns[label] + _product(products, rows[a], orders[a], undo_near[t], turned)]
                over = _product(products, rows[b], orders[b], over, far[k])
                over = _product(products, rows[b], orders[b], undo_far[t], over)
                image = their_ends[t]
                if over < orders[b] and _enter(visited, offsets[other] + rank[image] * orders[b] + over):
                    piece_of[other] = pieces
                    parts[filled + size], on[size], by[size] = other, image, over
                    size += 1
        filled += size
        owners[pieces] = owner[on[0]]
        pieces += 1
        starts[pieces] = filled
    return parts[:filled], starts[: pieces + 1], owners[:pieces]


@numba.njit(cache=True)
def cover(parts, starts, n):
    """Return how many of the pieces cover n parts by greedy set cover; a part in none of them counts as a piece."""
    pieces = len(starts) - 1
    first, following = np.full(n + 1, -1, dtype=np.int64), np.full(pieces, -1, dtype=np.int64)
    for piece in range(pieces - 1, -1, -1):
        size = starts[piece + 1] - starts[piece]
        following[piece], first[size] = first[size], piece
    covered, left, taken = np.zeros(n, dtype=np.bool_), n, 0
    for size in range(n, 1, -1):
        piece = first[size]
        while piece >= 0:
            after = following[piece]
            gain = 0
            for k in range(starts[piece], starts[piece + 1]):
                gain += not covered[parts[k]]
            if gain == size:
                taken += 1
                left -= gain
                for k in range(starts[piece], starts[piece + 1]):
                    covered[parts[k]] = True
            elif gain > 1:
                following[piece], first[gain] = first[gain], piece
            piece = after
    return taken + left
