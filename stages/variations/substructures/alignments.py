"""All region swaps along alignments: one shape laid on another, part on part as far as they coincide (substructures
§4.3.1).

Where the docking of every edge is known, a partial symmetry need not be read off the order of docking sites: laying one
part on another gives a rigid transform, which says where each further part lies. So matched parts can have different
numbers of neighbours; a docking site that is empty in one of the two is one of the boundary, as the paper's sites of a
type are. What does not coincide falls into regions, and each can be replaced: no other part has to move.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from stages.shape.geometry.hash_tables import contains, mix, with_key
from stages.shape.geometry.pose import invert
from stages.shape.kit import Assembly, Kit
from stages.variations.kernels.structs import MIN_UPRIGHT_COSINE
from stages.variations.substructures.growing_arrays import grown
from stages.variations.substructures.ordered_graph import OrderedGraph
from stages.variations.substructures.partial_symmetry import pair_hash
from stages.variations.substructures.region_swaps import RegionSwaps

MAX_SWAPS = 1 << 13
"""Region swaps listed between two shapes at most, which bounds memory."""
MAX_WORK = 1 << 24
"""Parts laid on others at most, between two shapes: a second or two."""
GOLDEN_RATIO = 0.6180339887
"""Multiples of it are spread evenly between whole numbers."""
SAME_ROTATION = 1e-3
"""Entries of rotations that differ by less are equal."""


class _Placed(NamedTuple):
    """The parts of a shape."""

    types: np.ndarray  # int64 (n,): of meshes
    rotations: np.ndarray  # float64 (n, 3, 3)
    translations: np.ndarray  # float64 (n, 3)
    centroids: np.ndarray  # float64 (n, 3)
    radii: np.ndarray  # float64 (n,): half diagonals
    order: np.ndarray  # int64 (n,): parts by type, then by the first coordinate of their centroids
    firsts: np.ndarray  # int64 (types + 1,): first of each type in `order`


def find_region_swaps(
    kit: Kit,
    up: int,
    base: tuple[Assembly, OrderedGraph],
    giver: tuple[Assembly, OrderedGraph],
    max_work: int = MAX_WORK,
) -> RegionSwaps:
    """Return all region swaps between two shapes, which may be the same, in which several regions are left over.

    Where one region is left over the result would be the giver.
    up: axis that alignments keep, or -1
    max_work: parts laid on others at most; pairs of parts are taken from everywhere in both shapes, so that a list that
        is cut short has the alignments under which most coincides
    """
    symmetries = np.concatenate([part_type.symmetries for part_type in kit.types])
    starts = np.cumsum([0, *(len(part_type.symmetries) for part_type in kit.types)])
    turns, shifts, regions, images, listed, meetings, work, is_whole = _enumerate(
        base[1], giver[1], _placed(kit, base[0]), _placed(kit, giver[0]), np.ascontiguousarray(symmetries[:, :3, :3]),
        np.ascontiguousarray(symmetries[:, :3, 3]), starts, up, kit.pose_tolerance, base[0] is giver[0], max_work,
    )  # fmt: skip
    alignments = np.tile(np.eye(4), (len(turns), 1, 1))
    alignments[:, :3, :3], alignments[:, :3, 3] = turns, shifts
    inverses = np.array([invert(alignment) for alignment in alignments]).reshape(-1, 4, 4)
    return RegionSwaps(inverses, regions, images, listed, meetings, work, is_whole)


def _placed(kit: Kit, assembly: Assembly) -> _Placed:
    own = [kit.types[index] for index in assembly.types.tolist()]
    rotations = np.ascontiguousarray(assembly.poses[:, :3, :3])
    translations = np.ascontiguousarray(assembly.poses[:, :3, 3])
    centroids = np.einsum("nij,nj->ni", rotations, np.stack([part.centroid for part in own])) + translations
    radii = np.array([part.diagonal / 2 for part in own])
    types = assembly.types.astype(np.int64)
    order = np.lexsort((centroids[:, 0], types))
    firsts = np.searchsorted(types[order], np.arange(len(kit.types) + 1))
    return _Placed(types, rotations, translations, centroids, radii, order, firsts)


@numba.njit(cache=True)
def _enumerate(a, b, here, there, turns, shifts, starts, up, tolerance, same, max_work):
    """List region swaps: `here` of graph `a` is the base, `there` of graph `b` the giver.

    state: leader, the union-find forest of regions: parts of the base, then of the giver, -1 where they coincide; image
        and back, the part of the other shape that a part coincides with, or -1; queue, the matched parts of the base;
        visited, the (part, part, symmetry) triples whose alignment was seen
    Invariant: between two alignments `image` and `back` are -1 everywhere.
    ends: all pairs are visited (`is_whole`), MAX_SWAPS are listed, or max_work is spent
    Returns turns and shifts that lay the base on the giver, regions and images of each, what is listed, meetings, work,
    and is_whole.
    """
    n, m = len(a.types), len(b.types)
    max_symmetries = 0
    for kind in range(len(starts) - 1):
        max_symmetries = max(max_symmetries, starts[kind + 1] - starts[kind])
    visited = np.zeros((n, m, max_symmetries), dtype=np.bool_)
    known, count, aligned, work, meetings = np.zeros(1 << 10, dtype=np.uint64), 0, 0, 0, 0
    is_whole = True
    out_turns, out_shifts = np.empty((64, 9)), np.empty((64, 3))
    regions, images = np.empty((64, n + m), dtype=np.int16), np.empty((64, m), dtype=np.int16)
    listed = np.empty((64, 2), dtype=np.int32)
    image, back, queue = np.full(n, -1), np.full(m, -1), np.empty(n, dtype=np.int64)
    leader, line = np.empty(n + m, dtype=np.int64), np.empty(n + m, dtype=np.int64)
    keys = np.empty(n + m, dtype=np.uint64)
    comes, met = np.empty(n + m, dtype=np.bool_), np.empty(n + m, dtype=np.bool_)
    for v, w in _spread(n, m):
        if here.types[v] != there.types[w]:
            continue
        first, last = starts[here.types[v]], starts[here.types[v] + 1]
        for symmetry in range(first, last):
            if visited[v, w, symmetry - first] or not is_whole or (same and v == w and symmetry == first):
                continue
            turn = there.rotations[w] @ turns[symmetry] @ here.rotations[v].T
            shift = there.rotations[w] @ shifts[symmetry] + there.translations[w] - turn @ here.translations[v]
            if up >= 0 and turn[up, up] < MIN_UPRIGHT_COSINE:
                continue
            if same and v == w and np.abs(turn - np.eye(3)).max() < SAME_ROTATION:
                continue
            matched, triples = _lay(here, there, turn, shift, turns, starts, tolerance, image, back, queue, visited)
            work += len(here.types)
            is_whole = work < max_work
            if matched == 0:
                continue
            _join_across(a, b, here, there, turn, shift, image, back, queue, matched, leader)
            if not _is_one(a, b, image, queue, matched, leader, line):
                keys[:], comes[:], met[:] = 0, False, False
                for node in range(n + m):
                    if leader[node] >= 0:
                        leader[node] = _root(leader, node)
                        keys[leader[node]] += mix(np.uint64(node + 7))
                        comes[leader[node]] |= node >= n
                for k in range(matched):
                    _mark(a, queue[k], 0, image, leader, keys, met, pair_hash(queue[k], image[queue[k]]))
                    _mark(b, image[queue[k]], n, back, leader, keys, met, pair_hash(image[queue[k]], queue[k]))
                before = count
                for root in range(n + m):
                    if leader[root] != root or not comes[root] or not met[root]:
                        continue
                    meetings += triples
                    key = keys[root] | np.uint64(1)
                    if contains(known, key):
                        continue
                    if count == MAX_SWAPS:
                        is_whole = False
                        break
                    known = with_key(known, count, key)
                    listed = grown(listed, count + 1)
                    listed[count] = aligned, root
                    count += 1
                if count > before:
                    regions, images = grown(regions, aligned + 1), grown(images, aligned + 1)
                    out_turns, out_shifts = grown(out_turns, aligned + 1), grown(out_shifts, aligned + 1)
                    regions[aligned], images[aligned] = leader, back
                    out_turns[aligned], out_shifts[aligned] = turn.copy().reshape(9), shift
                    aligned += 1
            for k in range(matched):
                back[image[queue[k]]] = -1
                image[queue[k]] = -1
    return (
        out_turns[:aligned].copy().reshape((aligned, 3, 3)),
        out_shifts[:aligned],
        regions[:aligned],
        images[:aligned],
        listed[:count],
        meetings,
        work,
        is_whole,
    )


@numba.njit(cache=True)
def _spread(n, m):
    """Return all pairs (v, w) of v < n and w < m, int64 (n * m, 2), each far from those before it."""
    total = n * m
    step = max(int(total * GOLDEN_RATIO), 1)
    while _divisor(step, total) > 1:
        step += 1
    pairs, index = np.empty((total, 2), dtype=np.int64), 0
    for k in range(total):
        pairs[k, 0], pairs[k, 1] = index // m, index % m
        index = (index + step) % total
    return pairs


@numba.njit(cache=True)
def _divisor(i, j):
    while j > 0:
        i, j = j, i % j
    return i


@numba.njit(cache=True)
def _lay(here, there, turn, shift, turns, starts, tolerance, image, back, queue, visited):
    """Lay part on part and mark the triples that give this alignment; return numbers of matched parts and triples."""
    count, triples = 0, 0
    for x in range(len(here.types)):
        (px, py, pz), kind = _moved(turn, shift, here.centroids[x]), here.types[x]
        low, end = there.firsts[kind], there.firsts[kind + 1]
        high = end
        while low < high:
            middle = (low + high) // 2
            if there.centroids[there.order[middle], 0] < px - tolerance:
                low = middle + 1
            else:
                high = middle
        while low < end and there.centroids[there.order[low], 0] <= px + tolerance:
            y = there.order[low]
            low += 1
            if (
                back[y] >= 0
                or abs(py - there.centroids[y, 1]) > tolerance
                or abs(pz - there.centroids[y, 2]) > tolerance
            ):
                continue
            rest = there.rotations[y].T @ turn @ here.rotations[x]
            for symmetry in range(starts[kind], starts[kind + 1]):
                if np.abs(rest - turns[symmetry]).max() < SAME_ROTATION:
                    visited[x, y, symmetry - starts[kind]] = True
                    image[x], back[y] = y, x
                    triples += 1
            if image[x] >= 0:
                queue[count] = x
                count += 1
                break
    return count, triples


@numba.njit(cache=True)
def _moved(turn, shift, place):
    """Return the coordinates of a place under an alignment."""
    return (
        turn[0, 0] * place[0] + turn[0, 1] * place[1] + turn[0, 2] * place[2] + shift[0],
        turn[1, 0] * place[0] + turn[1, 1] * place[1] + turn[1, 2] * place[2] + shift[1],
        turn[2, 0] * place[0] + turn[2, 1] * place[1] + turn[2, 2] * place[2] + shift[2],
    )


@numba.njit(cache=True)
def _join_across(a, b, here, there, turn, shift, image, back, queue, matched, leader):
    """Make each unmatched node a region, those of the giver counted on, and join regions whose parts take one place.

    Such parts are neighbours of one matched part.
    """
    n, m = len(a.types), len(b.types)
    for node in range(n + m):
        is_matched = image[node] >= 0 if node < n else back[node - n] >= 0
        leader[node] = -1 if is_matched else node
    for k in range(matched):
        x, y = queue[k], image[queue[k]]
        for d in range(a.starts[x], a.starts[x + 1]):
            near = a.tails[a.twins[d]]
            if leader[near] < 0:
                continue
            px, py, pz = _moved(turn, shift, here.centroids[near])
            for e in range(b.starts[y], b.starts[y + 1]):
                other = b.tails[b.twins[e]]
                if leader[n + other] < 0:
                    continue
                gx, gy, gz = (
                    px - there.centroids[other, 0],
                    py - there.centroids[other, 1],
                    pz - there.centroids[other, 2],
                )
                if gx * gx + gy * gy + gz * gz < max(here.radii[near], there.radii[other]) ** 2:
                    _join(leader, near, n + other)


@numba.njit(cache=True)
def _is_one(a, b, image, queue, matched, leader, line):
    """Return whether everything unmatched is one region; otherwise `leader` says what is.

    What is connected in either shape is joined, breadth first from what coincides, until one region is left.
    line: int64 (n + m,), room for the queue
    """
    n, count, regions = len(a.types), 0, 0
    is_reached = np.zeros(len(leader), dtype=np.bool_)
    for k in range(matched):
        for graph, node, offset in ((a, queue[k], 0), (b, image[queue[k]], n)):
            for d in range(graph.starts[node], graph.starts[node + 1]):
                near = offset + graph.tails[graph.twins[d]]
                if leader[near] >= 0 and not is_reached[near]:
                    is_reached[near] = True
                    line[count] = near
                    regions += _root(leader, near) == near
                    count += 1
    head = 0
    while regions > 1 and head < count:
        node = line[head]
        head += 1
        graph, offset = (a, 0) if node < n else (b, n)
        for d in range(graph.starts[node - offset], graph.starts[node - offset + 1]):
            near = offset + graph.tails[graph.twins[d]]
            if leader[near] < 0:
                continue
            if not is_reached[near]:
                is_reached[near] = True
                line[count] = near
                count += 1
            else:
                regions -= _root(leader, node) != _root(leader, near)
            _join(leader, node, near)
    return regions <= 1


@numba.njit(cache=True)
def _root(leader, node):
    while leader[node] != node:
        leader[node] = leader[leader[node]]
        node = leader[node]
    return node


@numba.njit(cache=True)
def _join(leader, i, j):
    if leader[i] < 0 or leader[j] < 0:
        return
    i, j = _root(leader, i), _root(leader, j)
    leader[max(i, j)] = min(i, j)


@numba.njit(cache=True)
def _mark(graph, node, offset, image, leader, keys, met, key):
    """Add a matched part to the keys of the regions that it bounds."""
    for d in range(graph.starts[node], graph.starts[node + 1]):
        near = graph.tails[graph.twins[d]]
        if image[near] < 0:
            root = leader[offset + near]
            keys[root] += key
            met[root] = True
