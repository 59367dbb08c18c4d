"""Shared surface: how much of two shapes is the same when they are laid upon each other as well as may be.

That is what point clouds see. Parts coincide where parts of one type have one centroid; their area, as a share of the
larger surface, is the measure: 1 for copies, and above about 0.8 two clouds are hardly farther apart than two samplings
of one shape. Motions are those that lay a part upon a part of its type, so a shared piece is found wherever it stands.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numba
import numpy as np
import numpy.typing as npt

from stages.shape.arrays import Float32Array, FloatArray, IntArray
from stages.shape.geometry.triangles import triangle_areas
from stages.shape.kit import Assembly, Kit

SEEDS = 24
"""Parts of each shape, drawn by area, by which motions are found and first judged."""
SPARE_MISSES = 3
"""So many seeds more may miss than a share lets expect."""
TOLERANCE = 4.0
"""Largest gap of centroids that coincide, in the kit's pose tolerance: poses drift from docking to docking."""
BATCH = 16
"""Shapes that are asked at once for the largest share."""
FLOORS = (0.7, 0.4, 0.0)
"""The largest share is looked for above each of these in turn: high ones are told soonest."""
UPRIGHT = 1.0 - 1e-3
"""Cosine from which on a motion leaves up where it is."""

Indices = npt.NDArray[np.int64]


class _Tables(NamedTuple):
    """Shapes as kernels see them.

    area: float64 (types,); symmetries: float64 (s, 3, 3) of all types, those of type t from `symmetries_from[t]`;
    centres: float32 (n, 3), and turns: int32 (n,) rows of rotations, float64 (r, 3, 3), of the parts of all shapes, by
    shape and type, then by x; firsts: int64 (shapes, types + 1), where the parts of a shape and type begin; seeds:
    int64 (shapes, SEEDS) parts, and kinds: int64, their types; areas: float64 (shapes,); up: the axis that motions
    leave where it is, or -1; tolerance: the largest gap of centroids that coincide.
    """

    area: FloatArray
    symmetries: FloatArray
    symmetries_from: Indices
    centres: Float32Array
    turns: IntArray
    rotations: FloatArray
    firsts: Indices
    seeds: Indices
    kinds: Indices
    areas: FloatArray
    up: int
    tolerance: float


class PackedShapes:
    """The parts of many assemblies of one kit in a few flat arrays, about 20 bytes a part.

    upright: whether shapes are laid upon each other by turns about the vertical only.
    """

    def __init__(self, kit: Kit, assemblies: Iterable[Assembly], upright: bool) -> None:
        area = np.array([triangle_areas(kind.vertices[kind.faces]).sum() for kind in kit.types])
        centroids = np.stack([each.centroid for each in kit.types])
        rotations: dict[bytes, int] = {}
        kept: list[FloatArray] = []
        firsts, seeds, kinds, centres, turns = [], [], [], [], []
        begin = 0
        for assembly in assemblies:
            turn_of, place = assembly.poses[:, :3, :3], assembly.poses[:, :3, 3]
            centre = np.einsum("nij,nj->ni", turn_of, centroids[assembly.types]) + place
            order = np.lexsort((centre[:, 0], assembly.types))
            own, numbers = assembly.types[order], []
            for turn in turn_of[order]:
                key = np.round(turn * 1e4).astype(np.int16).tobytes()
                if key not in rotations:
                    rotations[key] = len(kept)
                    kept.append(turn)
                numbers.append(rotations[key])
            drawn = _seeds(area[own])
            centres.append(centre[order].astype(np.float32))
            turns.append(np.array(numbers, dtype=np.int32))
            firsts.append(begin + np.searchsorted(own, np.arange(len(area) + 1)))
            seeds.append(begin + drawn)
            kinds.append(own[drawn])
            begin += len(own)
        first = np.array(firsts, dtype=np.int64).reshape(-1, len(area) + 1)
        self._counts = np.diff(first, axis=1)
        self._tables = _Tables(
            area=area,
            symmetries=np.concatenate([each.symmetries[:, :3, :3] for each in kit.types]),
            symmetries_from=np.cumsum([0, *(len(each.symmetries) for each in kit.types)]),
            centres=np.concatenate([np.empty((0, 3), np.float32), *centres]),
            turns=np.concatenate([np.empty(0, np.int32), *turns]),
            rotations=np.array(kept).reshape(-1, 3, 3),
            firsts=first,
            seeds=np.array(seeds, dtype=np.int64).reshape(-1, SEEDS),
            kinds=np.array(kinds, dtype=np.int64).reshape(-1, SEEDS),
            areas=self._counts @ area,
            up={"y": 1, "z": 2}[kit.up] if upright else -1,
            tolerance=TOLERANCE * kit.pose_tolerance,
        )

    def __len__(self) -> int:
        return len(self._counts)

    def shares(self, shape: int, others: Indices, least: float, enough: float = 1.0) -> FloatArray:
        """The surface that a shape shares with each of `others`, float64 (k,), as a share of the larger of the two;
        0 where it is less than `least`, and perhaps too little where it is more than `enough`."""
        found: FloatArray = np.zeros(len(others))
        able = np.flatnonzero(self._bounds(shape, others) >= least)
        found[able] = _shares(self._tables, shape, others[able], least, enough)
        return found

    def most_shared(self, shape: int, others: Indices) -> float:
        """The largest share that a shape has with one of `others`; those that may share most are asked first."""
        bounds = self._bounds(shape, others)
        order = np.argsort(-bounds, kind="stable")
        most = 0.0
        for least in FLOORS:
            for start in range(0, len(order), BATCH):
                batch = order[start : start + BATCH]
                if bounds[batch[0]] <= max(most, least):
                    break
                most = max(most, float(self.shares(shape, others[batch], max(most, least)).max()))
            if most > 0.0:
                break
        return most

    def _bounds(self, shape: int, others: Indices) -> FloatArray:
        """What a shape can share with others at most, by the types of their parts, float64 (k,)."""
        common = np.minimum(self._counts[shape], self._counts[others]) @ self._tables.area
        bounds: FloatArray = common / np.maximum(self._tables.areas[shape], self._tables.areas[others])
        return bounds


def _seeds(areas: FloatArray) -> Indices:
    """SEEDS parts, evenly spread over the surface of a shape, int64, in a scattered order."""
    reach = areas.cumsum()
    at = (np.arange(SEEDS) * 7 % SEEDS + 0.5) / SEEDS * reach[-1]
    seeds: Indices = np.searchsorted(reach, at).clip(0, len(areas) - 1)
    return seeds


@numba.njit(cache=True)
def _shares(tables, shape, others, least, enough):
    found = np.zeros(len(others))
    motion = np.empty((3, 4))
    work = np.empty(SEEDS, dtype=np.int64)
    area = tables.areas[shape]
    for place in range(len(others)):
        other = others[place]
        larger = max(area, tables.areas[other])
        # So many of the seeds may miss; of one more than that, however chosen, one must hit: the cheapest are tried.
        misses = min(int(SEEDS * (1.0 - least * larger / area) + 1e-9) + SPARE_MISSES, SEEDS - 1)
        for seed in range(SEEDS):
            kind = tables.kinds[shape, seed]
            targets = tables.firsts[other, kind + 1] - tables.firsts[other, kind]
            work[seed] = targets * (tables.symmetries_from[kind + 1] - tables.symmetries_from[kind])
        order = np.argsort(work, kind="mergesort")
        best = floor = np.nextafter(least * larger, 0.0)
        stop = max(min(enough * larger, 0.999 * area), least * larger)
        for first in range(misses + 1):
            best = _best_of_seed(tables, shape, other, order, first, misses, best, stop, motion)
            if best >= stop:
                break
        if best > floor:
            found[place] = best / larger
    return found


@numba.njit(cache=True)
def _best_of_seed(tables, shape, other, order, first, misses, best, stop, motion):
    """The largest area above `best` that coincides under a motion that lays the `first` seed of a shape in this order
    upon a part of the other's, or the first of at least `stop`; else `best`.

    The seeds are held against the other shape in the same order: what few parts can answer tells soonest that a motion
    is wrong. Those before `first` have missed with every motion that is any good, so they count as misses.
    """
    part, kind = tables.seeds[shape, order[first]], tables.kinds[shape, order[first]]
    for target in range(tables.firsts[other, kind], tables.firsts[other, kind + 1]):
        for symmetry in range(tables.symmetries_from[kind], tables.symmetries_from[kind + 1]):
            if not _lay_upon(tables, part, target, tables.symmetries[symmetry], motion):
                continue
            missed = first
            for place in range(first + 1, SEEDS):
                seed = order[place]
                if not _meets(tables, motion, tables.seeds[shape, seed], other, tables.kinds[shape, seed]):
                    missed += 1
                    if missed > misses:
                        break
            if missed <= misses:
                best = max(best, _met(tables, shape, other, best, motion))
                if best >= stop:
                    return best
    return best


@numba.njit(cache=True)
def _met(tables, shape, other, best, motion):
    """The area of a shape that coincides with the other's under a motion; 0 as soon as it cannot be above `best`."""
    left = tables.areas[shape]
    for kind in range(len(tables.area)):
        for part in range(tables.firsts[shape, kind], tables.firsts[shape, kind + 1]):
            if not _meets(tables, motion, part, other, kind):
                left -= tables.area[kind]
                if left <= best:
                    return 0.0
    return left


@numba.njit(cache=True)
def _lay_upon(tables, part, target, symmetry, motion):
    """The motion (3, 4) that takes a part to another of its type, turned by a symmetry; False where it tilts what must
    stay upright."""
    rotation, onto = tables.rotations[tables.turns[part]], tables.rotations[tables.turns[target]]
    up = tables.up
    if up >= 0:
        level = 0.0
        for k in range(3):
            for m in range(3):
                level += onto[up, k] * symmetry[k, m] * rotation[up, m]
        if level < UPRIGHT:
            return False
    centre, there = tables.centres[part], tables.centres[target]
    for i in range(3):
        a = onto[i, 0] * symmetry[0, 0] + onto[i, 1] * symmetry[1, 0] + onto[i, 2] * symmetry[2, 0]
        b = onto[i, 0] * symmetry[0, 1] + onto[i, 1] * symmetry[1, 1] + onto[i, 2] * symmetry[2, 1]
        c = onto[i, 0] * symmetry[0, 2] + onto[i, 1] * symmetry[1, 2] + onto[i, 2] * symmetry[2, 2]
        for j in range(3):
            motion[i, j] = a * rotation[j, 0] + b * rotation[j, 1] + c * rotation[j, 2]
    for i in range(3):
        moved = motion[i, 0] * centre[0] + motion[i, 1] * centre[1] + motion[i, 2] * centre[2]
        motion[i, 3] = there[i] - moved
    return True


@numba.njit(cache=True)
def _meets(tables, motion, part, other, kind):
    """Whether a part, moved, has the centroid of a part of its type in the other shape."""
    a, b, c = tables.centres[part, 0], tables.centres[part, 1], tables.centres[part, 2]
    x = motion[0, 0] * a + motion[0, 1] * b + motion[0, 2] * c + motion[0, 3]
    y = motion[1, 0] * a + motion[1, 1] * b + motion[1, 2] * c + motion[1, 3]
    z = motion[2, 0] * a + motion[2, 1] * b + motion[2, 2] * c + motion[2, 3]
    low, end = tables.firsts[other, kind], tables.firsts[other, kind + 1]
    high = end
    while low < high:
        middle = (low + high) // 2
        if tables.centres[middle, 0] < x - tables.tolerance:
            low = middle + 1
        else:
            high = middle
    while low < end and tables.centres[low, 0] <= x + tables.tolerance:
        centre = tables.centres[low]
        if abs(centre[1] - y) <= tables.tolerance and abs(centre[2] - z) <= tables.tolerance:
            return True
        low += 1
    return False
