"""All replacements along a rigid motion: one shape laid upon another, part upon part as far as they coincide
(substructures §4.3.1).

Where the docking of every edge is known, a partial symmetry need not be read off the order of docking sites: laying one
part upon another says by a rigid motion where each further part comes to lie. So parts may be matched that have not as
many neighbours, a docking site that is empty in one of the two being one of the boundary, as the paper's sites of a
type are. What does not coincide falls into regions, and each can be replaced: no other part has to move.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numba
import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose import invert
from stages.shape.kit import Assembly, Kit
from stages.variations.kernels.layout import UPRIGHT
from stages.variations.kernels.lookup import mix
from stages.variations.substitution.substitute import Docked
from stages.variations.substructures.keys import grown, holds, with_key
from stages.variations.substructures.ordered import OrderedGraph
from stages.variations.substructures.result_key import ODD_TYPE, refined
from stages.variations.substructures.symmetry import pair_hash

__all__ = ["MOST_MOVES", "Moves", "find_moves", "moved_key"]

MOST_MOVES = 1 << 13
"""Replacements along motions that are listed between two shapes at most: what bounds memory."""
MOST_WORK = 1 << 24
"""Parts that are laid upon others at most, between two shapes: a second or two."""
SAME_TURN = 1e-3
"""Entries of rotations that differ by less are equal."""


class _Placed(NamedTuple):
    """The parts of a shape: types int64 (n,), of meshes; rotations (n, 3, 3) and translations (n, 3) of their poses;
    centroids (n, 3); radii (n,), half their diagonals; order int64 (n,), parts by type, then by the first coordinate of
    their centroids, and firsts (types + 1,), where in it each type begins.
    """

    types: np.ndarray
    rotations: np.ndarray
    translations: np.ndarray
    centroids: np.ndarray
    radii: np.ndarray
    order: np.ndarray
    firsts: np.ndarray


@dataclass(frozen=True)
class Moves:
    """Replacements of a piece of a base by one of a giver along rigid motions.

    motions: float64 (k, 4, 4), bring each piece into the base; inside: bool (k, n + m), the parts of the base that
    leave and those of the giver that come; images: int16 (k, m), the part of the base that each part of the giver
    coincides with, or -1; meetings: how often they are met from all pairs of equal parts and their symmetries, each of
    which would have to be tried if equivalent replacements were not factored out; work: how many parts were laid upon
    others; is_whole: whether these are all, or what came
    first until a limit was met.
    """

    motions: FloatArray
    inside: np.ndarray
    images: np.ndarray
    meetings: int
    work: int
    is_whole: bool

    def __len__(self) -> int:
        return len(self.motions)

    def pieces(self, number: int) -> tuple[np.ndarray, np.ndarray]:
        """What one takes out of the base, bool (n,), and what comes of the giver, bool (m,)."""
        parts = self.inside.shape[1] - self.images.shape[1]
        return self.inside[number, :parts], self.inside[number, parts:]

    def docked(self, number: int, giver: OrderedGraph, poses: FloatArray) -> Docked:
        """The parts of the piece at its boundary, each with the part of the base that it docks to, and its own of the
        giver's `poses` (m, 4, 4)."""
        image, (_, piece) = self.images[number], self.pieces(number)
        inner, outer = giver.tails, giver.tails[giver.twins]
        across = piece[inner] & (image[outer] >= 0)
        return [
            (part, int(image[other]), poses[part])
            for part, other in zip(inner[across].tolist(), outer[across].tolist(), strict=True)
        ]


def find_moves(kit: Kit, up: int, base: tuple[Assembly, OrderedGraph], giver: tuple[Assembly, OrderedGraph]) -> Moves:
    """All replacements of a piece of the base by one of the giver, which may be the same, that are a region of what two
    greatest pieces that coincide leave over, where they leave several: of one the result is the giver.

    up: the axis that motions keep upright, or -1.
    """
    symmetries = np.concatenate([each.symmetries for each in kit.types])
    starts = np.cumsum([0, *(len(each.symmetries) for each in kit.types)])
    found = _enumerate(
        base[1], giver[1], _placed(kit, base[0]), _placed(kit, giver[0]), np.ascontiguousarray(symmetries[:, :3, :3]),
        np.ascontiguousarray(symmetries[:, :3, 3]), starts, up, kit.pose_tolerance, base[0] is giver[0],
    )  # fmt: skip
    turns, shifts, inside, images, meetings, work, is_whole = found
    motions = np.tile(np.eye(4), (len(turns), 1, 1))
    motions[:, :3, :3], motions[:, :3, 3] = turns, shifts
    return Moves(
        np.array([invert(each) for each in motions]).reshape(-1, 4, 4), inside, images, meetings, work, is_whole
    )


def _placed(kit: Kit, assembly: Assembly) -> _Placed:
    own = [kit.types[index] for index in assembly.types.tolist()]
    rotations = np.ascontiguousarray(assembly.poses[:, :3, :3])
    translations = np.ascontiguousarray(assembly.poses[:, :3, 3])
    centroids = np.einsum("nij,nj->ni", rotations, np.stack([each.centroid for each in own])) + translations
    radii = np.array([each.diagonal / 2 for each in own])
    types = assembly.types.astype(np.int64)
    order = np.lexsort((centroids[:, 0], types))
    firsts = np.searchsorted(types[order], np.arange(len(kit.types) + 1))
    return _Placed(types, rotations, translations, centroids, radii, order, firsts)


@numba.njit(cache=True)
def _enumerate(a, b, here, there, turns, shifts, starts, up, tolerance, same):
    """Turns and shifts that lay the base upon the giver, what leaves and comes, images, meetings, work, whether it is
    all."""
    n, m = len(a.types), len(b.types)
    most = 0
    for kind in range(len(starts) - 1):
        most = max(most, starts[kind + 1] - starts[kind])
    visited = np.zeros((n, m, most), dtype=np.bool_)
    listed, count, work, meetings = np.zeros(1 << 10, dtype=np.uint64), 0, 0, 0
    is_whole = True
    out_turns, out_shifts = np.empty((64, 9)), np.empty((64, 3))
    inside, images = np.empty((64, n + m), dtype=np.bool_), np.empty((64, m), dtype=np.int16)
    image, back, queue = np.full(n, -1), np.full(m, -1), np.empty(n, dtype=np.int64)
    leader, line = np.empty(n + m, dtype=np.int64), np.empty(n + m, dtype=np.int64)
    keys = np.empty(n + m, dtype=np.uint64)
    comes, met = np.empty(n + m, dtype=np.bool_), np.empty(n + m, dtype=np.bool_)
    for v in range(n):
        for w in range(m):
            if here.types[v] != there.types[w]:
                continue
            first, last = starts[here.types[v]], starts[here.types[v] + 1]
            for g in range(first, last):
                if visited[v, w, g - first] or not is_whole or (same and v == w and g == first):
                    continue
                turn = there.rotations[w] @ turns[g] @ here.rotations[v].T
                shift = there.rotations[w] @ shifts[g] + there.translations[w] - turn @ here.translations[v]
                if up >= 0 and turn[up, up] < UPRIGHT:
                    continue
                if same and v == w and np.abs(turn - np.eye(3)).max() < SAME_TURN:
                    continue
                matched, ways = _lay(here, there, turn, shift, turns, starts, tolerance, image, back, queue, visited)
                work += len(here.types)
                is_whole = work < MOST_WORK
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
                    for root in range(n + m):
                        if leader[root] != root or not comes[root] or not met[root]:
                            continue
                        meetings += ways
                        key = keys[root] | np.uint64(1)
                        if holds(listed, key):
                            continue
                        if count == MOST_MOVES:
                            is_whole = False
                            break
                        listed = with_key(listed, count, key)
                        inside, images = grown(inside, count + 1), grown(images, count + 1)
                        out_turns, out_shifts = grown(out_turns, count + 1), grown(out_shifts, count + 1)
                        for node in range(n + m):
                            inside[count, node] = leader[node] == root
                        images[count] = back
                        out_turns[count], out_shifts[count] = turn.copy().reshape(9), shift
                        count += 1
                for k in range(matched):
                    back[image[queue[k]]] = -1
                    image[queue[k]] = -1
    return (
        out_turns[:count].copy().reshape((count, 3, 3)),
        out_shifts[:count],
        inside[:count],
        images[:count],
        meetings,
        work,
        is_whole,
    )


@numba.njit(cache=True)
def _lay(here, there, turn, shift, turns, starts, tolerance, image, back, queue, visited):
    """Lay part upon part and tick off what lays them so; how many coincide, and how many ways were ticked off."""
    count, ways = 0, 0
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
            for h in range(starts[kind], starts[kind + 1]):
                if np.abs(rest - turns[h]).max() < SAME_TURN:
                    visited[x, y, h - starts[kind]] = True
                    image[x], back[y] = y, x
                    ways += 1
            if image[x] >= 0:
                queue[count] = x
                count += 1
                break
    return count, ways


@numba.njit(cache=True)
def _moved(turn, shift, place):
    """The coordinates of a place that is turned and shifted."""
    return (
        turn[0, 0] * place[0] + turn[0, 1] * place[1] + turn[0, 2] * place[2] + shift[0],
        turn[1, 0] * place[0] + turn[1, 1] * place[1] + turn[1, 2] * place[2] + shift[1],
        turn[2, 0] * place[0] + turn[2, 1] * place[1] + turn[2, 2] * place[2] + shift[2],
    )


@numba.njit(cache=True)
def _join_across(a, b, here, there, turn, shift, image, back, queue, matched, leader):
    """Make each node a region of its own, those of the giver counted on, -1 of matched ones; and join those across a
    part that coincides, where two of its neighbours take one place."""
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
    """Whether all that does not coincide is one region; else `leader` says what is: what hangs together in either shape
    is joined.

    It is looked at breadth-first from next to what coincides, and no farther than until one is seen, which is soon.
    `line` int64 (n + m,) is room for what waits.
    """
    n, count, regions = len(a.types), 0, 0
    is_met = np.zeros(len(leader), dtype=np.bool_)
    for k in range(matched):
        for graph, node, offset in ((a, queue[k], 0), (b, image[queue[k]], n)):
            for d in range(graph.starts[node], graph.starts[node + 1]):
                near = offset + graph.tails[graph.twins[d]]
                if leader[near] >= 0 and not is_met[near]:
                    is_met[near] = True
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
            if not is_met[near]:
                is_met[near] = True
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


@numba.njit(cache=True)
def moved_key(base, giver, taken, piece, image):
    """The key of the result, as `result_key` reckons it: parts of the giver that coincide with one of the base, as
    `image` int16 (m,) says, bring their edges to the piece along."""
    n = len(base.types)
    place, count = np.full(n + len(giver.types), -1, dtype=np.int64), 0
    for node in range(len(place)):
        if not taken[node] if node < n else piece[node - n]:
            place[node] = count
            count += 1
    most = len(base.tails) + 2 * len(giver.tails)
    edges, labels = np.empty((most, 2), dtype=np.int64), np.empty(most, dtype=np.uint64)
    colours, filled = np.empty(count, dtype=np.uint64), 0
    for node in range(len(place)):
        if place[node] >= 0:
            kind = base.types[node] if node < n else giver.types[node - n]
            colours[place[node]] = mix(np.uint64(kind) + ODD_TYPE)
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
