"""The pieces of a shape that stand rigidly so in an exemplar, and the fewest of them that cover it.

A part p lies on a part q of an exemplar by symmetry s where the motion that lays pose(p) on pose(q) * s is meant. As
the motion is rigid, each part that p touches then lies on at most one part that q touches, by one symmetry: the piece
is what is reached so, and a triple (p, q, s) belongs to one piece alone. Each contact is written as its docking and the
symmetries of both its parts, pose = symmetry[near] * docking * symmetry[far], so that all of this is counting in
groups. Symmetries are numbered within their type; the number after the last one stands for none.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np


class Groups(NamedTuple):
    """The symmetry groups of part types.

    orders int64 (types,): numbers of symmetries; starts int64 (types,): where those of a type start in rotations
    float64 (s, 3, 3) and inverses, signs int64 (s,), the latter -1 for reflections; products int64 (p,): from rows
    int64 (types,) on, in rows of one more than the order, the number of each product; reach float64 (types,): half
    diagonals.
    """

    orders: np.ndarray
    starts: np.ndarray
    rotations: np.ndarray
    inverses: np.ndarray
    signs: np.ndarray
    products: np.ndarray
    rows: np.ndarray
    reach: np.ndarray


class Dockings(NamedTuple):
    """The directed dockings, by label.

    ends int64 (labels, 2): types of the part that it is seen from and of the other; rotations float64 (labels, 3, 3),
    translations float64 (labels, 3): one pose of the other; passed int64 (t,): from rows int64 (labels,) on, for each
    symmetry of the first part the one of the other that does the same to the two, or none; kept int64 (c,): from
    kept_starts int64 (labels + 1,) on the symmetries of the first part that have one; spots int64 (t,), as passed: the
    number of the place where the other then stands, among all those around the first part's type, of which there are
    spot_counts int64 (types,); tolerance: of poses, in kit units.
    """

    ends: np.ndarray
    rotations: np.ndarray
    translations: np.ndarray
    passed: np.ndarray
    rows: np.ndarray
    kept: np.ndarray
    kept_starts: np.ndarray
    spots: np.ndarray
    spot_counts: np.ndarray
    tolerance: float


class Joints(NamedTuple):
    """The contacts of a shape seen from both ends: starts int64 (n + 1,), ends, labels, near and far int64 (2 m,), the
    last two being the symmetries of the part they are seen from and of the other."""

    starts: np.ndarray
    ends: np.ndarray
    labels: np.ndarray
    near: np.ndarray
    far: np.ndarray


class Target(NamedTuple):
    """All exemplars as one: rank int64 (n,): number of a part among those of its type; type_sizes int64 (types,);
    handed int64 (n,), -1 for parts that are placed as mirror images; owner int64 (n,): the exemplar of each part; sizes
    int64 (exemplars,); joints, and undo_near, undo_far int64 (2 m,): the inverses of their near and far; at int32
    (c,): from at_starts int64 (n,) on, for each spot around a part the joint to what stands there, or -1; tails int64
    (2 m,): the part that each joint is seen from; by_label int64 (2 m,): joints in order of their labels, from
    label_starts int64 (labels + 1,) on."""

    rank: np.ndarray
    type_sizes: np.ndarray
    handed: np.ndarray
    owner: np.ndarray
    sizes: np.ndarray
    joints: Joints
    undo_near: np.ndarray
    undo_far: np.ndarray
    at: np.ndarray
    at_starts: np.ndarray
    tails: np.ndarray
    by_label: np.ndarray
    label_starts: np.ndarray


@numba.njit(cache=True)
def locate(groups, dockings, shape):
    """The symmetries near and far, int64 (2 m,), by which each contact of a shape is an image of its docking."""
    near, far = np.zeros(len(shape.ends), dtype=np.int64), np.zeros(len(shape.ends), dtype=np.int64)
    spot, turned, between = np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    place, pose = np.empty(3), np.empty((3, 3))
    # An image is taken at once where it is so near that another one as near is the same.
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
                    spot[i] = 0.0
                    for m in range(3):
                        spot[i] += symmetry[i, m] * dockings.translations[label, m]
                    gap += (spot[i] - place[i]) ** 2
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
    """The number of the product of two symmetries of a type."""
    return products[row + first * (order + 1) + second]


@numba.njit(cache=True)
def _enter(visited, bit):
    """Whether nobody has been at a triple before; somebody has from now on."""
    mask = np.uint64(1) << np.uint64(bit & 63)
    if visited[bit >> 6] & mask:
        return False
    visited[bit >> 6] |= mask
    return True


@numba.njit(cache=True)
def _rarest_first(joints, target):
    """The contacts of a shape, each once, int64 (k,), those first whose docking the exemplars have least of."""
    chosen, times = np.empty(len(joints.ends), dtype=np.int64), np.empty(len(joints.ends), dtype=np.int64)
    count = 0
    for p in range(len(joints.starts) - 1):
        for k in range(joints.starts[p], joints.starts[p + 1]):
            label = joints.labels[k]
            if joints.ends[k] > p and label >= 0:
                chosen[count] = k
                times[count] = target.label_starts[label + 1] - target.label_starts[label]
                count += 1
    return chosen[np.argsort(times[:count], kind="mergesort")]


@numba.njit(cache=True)
def _seeds(groups, dockings, types, handed, tails, joints, target, budget):
    """The ways to lay a contact of a shape on one of an exemplar, rarest dockings first, at most `budget`: int64 (k, 3)
    triples (p, q, s) of a part, the part that it lies on and by which symmetry."""
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
    """The largest connected pieces, of two parts and more, of a shape that stand so in an exemplar by one rigid motion:
    parts int64 (p,), starts int64 (k + 1,) of each piece in them, and the exemplar of each, int64 (k,).

    They are grown breadth first from the rarest dockings on, until `budget` contacts have been looked at; no clock
    decides what is found. types, handed, tails and joints: of the shape, as those of `target`.
    """
    # To take an array out of a tuple counts a reference, which in the loop would cost more than what is done there.
    orders, products, rows = groups.orders, groups.products, groups.rows
    passed, spots, turns = dockings.passed, dockings.spots, dockings.rows
    joint_starts, ends, labels, near, far = joints
    their_ends, standing, standing_starts = target.joints.ends, target.at, target.at_starts
    undo_near, undo_far, rank, owner = target.undo_near, target.undo_far, target.rank, target.owner
    n = len(types)
    spans = orders[types] * target.type_sizes[types]
    # A bit for each triple (p, q, s); q and s of the parts of the piece in hand; the last piece that a part was in.
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
                t = standing[standing_starts[q] + spots[turns[label] + turned]]
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
    """How many of the pieces cover n parts, each the one that covers most of what those before it left, and parts in
    none of them alone (greedy set cover)."""
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
