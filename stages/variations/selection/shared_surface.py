"""Shared surface: how much of two shapes coincides when they are laid on each other as well as possible.

Parts coincide where parts of one type have one centroid. The measure is their area as a share of the larger surface: 1
for copies; above about 0.8 two point clouds are hardly farther apart than two samplings of one shape. Alignments are
those that lay a part on a part of its type, so a shared piece is found wherever it is.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numba
import numpy as np
import numpy.typing as npt
from numba import int64, uint64
from numba.extending import intrinsic

from stages.shape.arrays import Float32Array, FloatArray, IntArray
from stages.shape.geometry.triangles import triangle_areas
from stages.shape.kit import Assembly, Kit

SEEDS_PER_SHAPE = 24
"""Parts of each shape, spread over its area, by which alignments are proposed and first judged."""
SPARE_MISSES = 3
"""Seeds that may miss beyond what a share allows."""
CENTROID_TOLERANCES = 4.0
"""Largest gap of coinciding centroids, in pose tolerances: poses drift from docking to docking."""
BATCH_SIZE = 16
"""Shapes that are compared at once for the largest share."""
SHARE_FLOORS = (0.7, 0.4, 0.0)
"""The largest share is sought above each of these in turn: high shares are found fastest."""
MIN_UPRIGHT_COSINE = 1.0 - 1e-3
"""Cosine from which an alignment keeps the vertical."""
MAX_ROTATIONS_KEPT = 4096
"""Rotations of one seed that are kept while a shape is compared with others."""
BITS_PER_PART = 8
CELL_TOLERANCES = 8.0
"""Width of the cells whose occupation is noted, in tolerances: a part occupies two of them on average."""

SIGNATURE_WORDS = 4
"""Words of 64 bits that note around each part where the others are."""
SIGNATURE_CELL_TOLERANCES = 16.0
"""Width of the cells of these places, in tolerances."""
MAX_PARTS_NOTED = 160
"""Mean number of parts up to which they are noted: the bits around a part of a larger shape are nearly all set."""
MAX_ROUNDING = 1e-9
"""Largest difference of two sums of the same areas, as a share."""

Indices = npt.NDArray[np.int64]


class _Tables(NamedTuple):
    """Packed shapes for compiled code. Parts are ordered by shape and type, then by x."""

    area: FloatArray  # float64 (types,): area of a part
    symmetries: FloatArray  # float64 (s, 3, 3): of all types
    symmetries_from: Indices  # int64 (types + 1,): first symmetry of each type
    centres: Float32Array  # float32 (n, 3): centroids of the parts of all shapes
    turns: IntArray  # int32 (n,): rows of `rotations`
    rotations: FloatArray  # float64 (r, 3, 3)
    firsts: Indices  # int64 (shapes, types + 1): first part of each shape and type
    seeds: Indices  # int64 (shapes, SEEDS_PER_SHAPE): parts
    kinds: Indices  # int64 (shapes, SEEDS_PER_SHAPE): their types
    areas: FloatArray  # float64 (shapes,)
    up: int  # axis that alignments keep, or -1
    tolerance: float  # largest gap of coinciding centroids, in kit units
    cell: float  # width of a cell, in kit units
    occupied: npt.NDArray[np.uint64]  # uint64 (shapes, words): a bit for each cell and type where a part may be met
    signatures: npt.NDArray[np.uint64]  # uint64 (n, SIGNATURE_WORDS): bits of the parts around each; or empty


class PackedShapes:
    """The parts of many assemblies of one kit in flat arrays, about 20 bytes a part.

    upright: whether alignments turn about the vertical only
    """

    def __init__(self, kit: Kit, assemblies: Iterable[Assembly], upright: bool) -> None:
        area = np.array([triangle_areas(part_type.vertices[part_type.faces]).sum() for part_type in kit.types])
        centroids = np.stack([part_type.centroid for part_type in kit.types])
        rotations: dict[bytes, int] = {}
        kept: list[FloatArray] = []
        firsts, seeds, kinds, centres, turns = [], [], [], [], []
        begin = 0
        for assembly in assemblies:
            turn_of, place = assembly.poses[:, :3, :3], assembly.poses[:, :3, 3]
            centre = np.einsum("nij,nj->ni", turn_of, centroids[assembly.types]) + place
            order = np.lexsort((centre[:, 0], assembly.types))
            own, numbers = assembly.types[order], []
            keys = np.round(turn_of[order] * 1e4).astype(np.int16)
            for turn, rounded in zip(turn_of[order], keys, strict=True):
                key = rounded.tobytes()
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
        packed = np.concatenate([np.empty((0, 3), np.float32), *centres])
        turn_numbers = np.concatenate([np.empty(0, np.int32), *turns])
        del centres, turns  # before more is allocated
        are_noted = len(packed) <= MAX_PARTS_NOTED * len(first)
        tolerance = CENTROID_TOLERANCES * kit.pose_tolerance
        self._tables = _Tables(
            area=area,
            symmetries=np.concatenate([part_type.symmetries[:, :3, :3] for part_type in kit.types]),
            symmetries_from=np.cumsum([0, *(len(part_type.symmetries) for part_type in kit.types)]),
            centres=packed,
            turns=turn_numbers,
            rotations=np.array(kept).reshape(-1, 3, 3),
            firsts=first,
            seeds=np.array(seeds, dtype=np.int64).reshape(-1, SEEDS_PER_SHAPE),
            kinds=np.array(kinds, dtype=np.int64).reshape(-1, SEEDS_PER_SHAPE),
            areas=self._counts @ area,
            up={"y": 1, "z": 2}[kit.up] if upright else -1,
            tolerance=tolerance,
            cell=CELL_TOLERANCES * tolerance,
            occupied=_occupied_cells(packed, first, CELL_TOLERANCES * tolerance, tolerance),
            signatures=_signatures(packed, first if are_noted else first[:0], tolerance),
        )

    def __len__(self) -> int:
        return len(self._counts)

    def shares(self, shape: int, others: Indices, least: float, enough: float = 1.0) -> FloatArray:
        """Return the surface that a shape shares with each of `others`, float64 (k,), as a share of the larger of the
        two.

        It is 0 where it is less than `least`, and may be too small where it is more than `enough`.
        """
        shared: FloatArray = np.zeros(len(others))
        possible = self._possible(shape, others, least)
        shared[possible] = _shares(self._tables, shape, others[possible], least, enough)
        return shared

    def most_shared(self, shape: int, others: Indices) -> float:
        """Return the largest share that a shape has with one of `others`; promising ones are compared first."""
        bounds = self._bounds(shape, others)
        order = np.argsort(-bounds, kind="stable")
        most = 0.0
        for least in SHARE_FLOORS:
            for start in range(0, len(order), BATCH_SIZE):
                batch = order[start : start + BATCH_SIZE]
                if bounds[batch[0]] <= max(most, least):
                    break
                most = max(most, float(self.shares(shape, others[batch], max(most, least)).max()))
            if most > 0.0:
                break
        return most

    def _possible(self, shape: int, others: Indices, least: float) -> Indices:
        """Return which of `others` may share at least `least` by the types of their parts, as `_bounds`, int64 (k,)."""
        possible, is_tied = _possible_by_type(self._counts, self._tables.area, self._tables.areas, shape, others, least)
        return np.flatnonzero(self._bounds(shape, others) >= least) if is_tied else possible

    def _bounds(self, shape: int, others: Indices) -> FloatArray:
        """Return upper bounds of what a shape shares with others, by the types of their parts, float64 (k,)."""
        common = np.minimum(self._counts[shape], self._counts[others]) @ self._tables.area
        bounds: FloatArray = common / np.maximum(self._tables.areas[shape], self._tables.areas[others])
        return bounds


def _seeds(areas: FloatArray) -> Indices:
    """Return SEEDS_PER_SHAPE parts, evenly spread over the surface of a shape, int64, in a scattered order."""
    reach = areas.cumsum()
    area_at = (np.arange(SEEDS_PER_SHAPE) * 7 % SEEDS_PER_SHAPE + 0.5) / SEEDS_PER_SHAPE * reach[-1]
    seeds: Indices = np.searchsorted(reach, area_at).clip(0, len(areas) - 1)
    return seeds


@numba.njit(cache=True)
def _possible_by_type(counts, area, areas, shape, others, least):
    """Return which of `others` may share at least `least`, int64 (k,), and whether rounding decides for any of them."""
    possible, found, is_tied = np.empty(len(others), dtype=np.int64), 0, False
    for place in range(len(others)):
        other = others[place]
        common = 0.0
        for kind in range(len(area)):
            common += min(counts[shape, kind], counts[other, kind]) * area[kind]
        larger = max(areas[shape], areas[other])
        if larger == 0.0:
            continue
        bound = common / larger
        is_tied |= abs(bound - least) <= MAX_ROUNDING
        possible[found] = place
        found += bound >= least
    return possible[:found], is_tied


@numba.njit(cache=True)
def _shares(tables, shape, others, least, enough):
    # Arrays of their own: a call with all tables costs more than what most calls do.
    kinds, seeds, firsts, centres, turns = tables.kinds, tables.seeds, tables.firsts, tables.centres, tables.turns
    areas, symmetries_from, symmetries = tables.areas, tables.symmetries_from, tables.symmetries
    occupied, signatures = tables.occupied, tables.signatures
    rotations, up, per_unit = tables.rotations, tables.up, 1.0 / tables.cell
    part_areas, tolerance = tables.area, tables.tolerance
    bits = occupied.shape[1] * 64
    shares = np.zeros(len(others))
    alignment = np.empty((3, 4))
    ranked = np.arange(SEEDS_PER_SHAPE)
    area = areas[shape]
    most_symmetries = 1
    for kind in range(len(symmetries_from) - 1):
        most_symmetries = max(most_symmetries, symmetries_from[kind + 1] - symmetries_from[kind])
    # Rotations that lay a seed on parts of its type in each rotation, by its symmetries: 0 until known, 2 if tilted.
    kept = len(rotations) * most_symmetries <= MAX_ROTATIONS_KEPT
    known = np.zeros((SEEDS_PER_SHAPE, len(rotations) if kept else 1, most_symmetries), dtype=np.int8)
    noted = kept and len(signatures) > 0
    laid = np.empty((SEEDS_PER_SHAPE, len(rotations) if kept else 1, most_symmetries, 3, 3))
    masks = np.zeros((*known.shape, SIGNATURE_WORDS), dtype=np.uint64)
    for place in range(len(others)):
        other = others[place]
        larger = max(area, areas[other])
        # Of `misses` + 1 seeds, however chosen, one must hit: the cheapest are tried.
        misses = min(int(SEEDS_PER_SHAPE * (1.0 - least * larger / area) + 1e-9) + SPARE_MISSES, SEEDS_PER_SHAPE - 1)
        _rank_seeds(kinds[shape], firsts[other], symmetries_from, ranked)
        best = floor = np.nextafter(least * larger, 0.0)
        stop = max(min(enough * larger, 0.999 * area), least * larger)
        for first in range(misses + 1):
            seed = ranked[first] % SEEDS_PER_SHAPE
            part, kind = seeds[shape, seed], kinds[shape, seed]
            for target in range(firsts[other, kind], firsts[other, kind + 1]):
                turn = turns[target] if kept else 0
                for number in range(symmetries_from[kind + 1] - symmetries_from[kind]):
                    if not kept or known[seed, turn, number] == 0:
                        symmetry = symmetries[symmetries_from[kind] + number]
                        level = _lay_upon(rotations, turns[part], turns[target], symmetry, up, laid[seed, turn, number])
                        known[seed, turn, number] = 1 if level else 2
                        if level and noted:
                            _note_seeds(tables, shape, seed, laid[seed, turn, number], masks[seed, turn, number])
                    if known[seed, turn, number] == 2:
                        continue
                    # Most alignments are wrong. The surroundings of the target tell it of nearly all of them.
                    if noted:
                        missing = 0
                        for word in range(SIGNATURE_WORDS):
                            missing += count_bits(masks[seed, turn, number, word] & ~signatures[target, word])
                        if missing > misses:
                            continue
                    turned = laid[seed, turn, number]
                    # The cells that the other shape occupies tell it of most that are left.
                    missed = first
                    for later in range(first + 1, SEEDS_PER_SHAPE):
                        moved = seeds[shape, ranked[later] % SEEDS_PER_SHAPE]
                        a = np.float64(centres[moved, 0]) - centres[part, 0]
                        b = np.float64(centres[moved, 1]) - centres[part, 1]
                        c = np.float64(centres[moved, 2]) - centres[part, 2]
                        x = turned[0, 0] * a + turned[0, 1] * b + turned[0, 2] * c + centres[target, 0]
                        y = turned[1, 0] * a + turned[1, 1] * b + turned[1, 2] * c + centres[target, 1]
                        z = turned[2, 0] * a + turned[2, 1] * b + turned[2, 2] * c + centres[target, 2]
                        own_kind = kinds[shape, ranked[later] % SEEDS_PER_SHAPE]
                        bit = _bit(own_kind, _cell(x, per_unit), _cell(y, per_unit), _cell(z, per_unit), bits)
                        if not (occupied[other, bit >> 6] >> np.uint64(bit & 63)) & np.uint64(1):
                            missed += 1
                            if missed > misses:
                                break
                    if missed > misses:
                        continue
                    _shift_to(centres, part, target, turned, alignment)
                    missed = first
                    for later in range(first + 1, SEEDS_PER_SHAPE):
                        moved = seeds[shape, ranked[later] % SEEDS_PER_SHAPE]
                        own_kind = kinds[shape, ranked[later] % SEEDS_PER_SHAPE]
                        low, end = firsts[other, own_kind], firsts[other, own_kind + 1]
                        if not _meets(centres, alignment, moved, low, end, tolerance):
                            missed += 1
                            if missed > misses:
                                break
                    if missed > misses:
                        continue
                    # The area that coincides, unless it cannot exceed the best.
                    left = area
                    for own_kind in range(len(part_areas)):
                        low, end = firsts[other, own_kind], firsts[other, own_kind + 1]
                        for moved in range(firsts[shape, own_kind], firsts[shape, own_kind + 1]):
                            if not _meets(centres, alignment, moved, low, end, tolerance):
                                left -= part_areas[own_kind]
                                if left <= best:
                                    break
                        if left <= best:
                            break
                    best = max(best, left)
                    if best >= stop:
                        break
                if best >= stop:
                    break
            if best >= stop:
                break
        if best > floor:
            shares[place] = best / larger
    return shares


@numba.njit(cache=True)
def _rank_seeds(kinds, firsts, symmetries_from, ranked):
    """Sort the seeds of a shape by the number of alignments with another that they propose; of equals the first.

    ranked: int64 (SEEDS_PER_SHAPE,), a seed in any order each, plus a multiple of SEEDS_PER_SHAPE; rewritten
    """
    for place in range(len(ranked)):
        seed = ranked[place] % SEEDS_PER_SHAPE
        kind = kinds[seed]
        work = (firsts[kind + 1] - firsts[kind]) * (symmetries_from[kind + 1] - symmetries_from[kind])
        key = work * SEEDS_PER_SHAPE + seed
        before = place
        while before > 0 and ranked[before - 1] > key:
            ranked[before] = ranked[before - 1]
            before -= 1
        ranked[before] = key


@intrinsic  # type: ignore[untyped-decorator]
def count_bits(typing_context: Any, word: Any) -> Any:
    """Return the number of bits that are set in a word of 64 bits."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.ctpop(arguments[0])

    return int64(uint64), generate


@numba.njit(cache=True)
def _signatures(centres, firsts, tolerance):
    """Return the bits of the types and places, relative to each part, at which a part of its shape may be met.

    A part has at least the bits of `_note_seeds` of each seed that an alignment, which lays a seed on it, takes to a
    part. Returns uint64 (n, SIGNATURE_WORDS), empty without shapes.
    """
    signatures = np.zeros((len(centres) if len(firsts) else 0, SIGNATURE_WORDS), dtype=np.uint64)
    per_unit = 1.0 / (SIGNATURE_CELL_TOLERANCES * tolerance)
    gap = 1.01 * tolerance  # rounding must not take a place out of its cells
    for shape in range(len(firsts)):
        for part in range(firsts[shape, 0], firsts[shape, -1]):
            own = signatures[part]
            x, y, z = np.float64(centres[part, 0]), np.float64(centres[part, 1]), np.float64(centres[part, 2])
            for kind in range(firsts.shape[1] - 1):
                for other in range(firsts[shape, kind], firsts[shape, kind + 1]):
                    a, b, c = centres[other, 0] - x, centres[other, 1] - y, centres[other, 2] - z
                    for i in range(_cell(a - gap, per_unit), _cell(a + gap, per_unit) + 1):
                        for j in range(_cell(b - gap, per_unit), _cell(b + gap, per_unit) + 1):
                            for k in range(_cell(c - gap, per_unit), _cell(c + gap, per_unit) + 1):
                                bit = _bit(kind, i, j, k, SIGNATURE_WORDS * 64)
                                own[bit >> 6] |= np.uint64(1) << np.uint64(bit & 63)
    return signatures


@numba.njit(cache=True)
def _note_seeds(tables, shape, seed, turned, mask):
    """Set the bits of the types and places of all seeds relative to one of them, turned by a rotation (3, 3).

    mask: uint64 (SIGNATURE_WORDS,), written
    """
    per_unit = 1.0 / (SIGNATURE_CELL_TOLERANCES * tables.tolerance)
    part = tables.seeds[shape, seed]
    for other in range(SEEDS_PER_SHAPE):
        moved = tables.seeds[shape, other]
        a = np.float64(tables.centres[moved, 0]) - tables.centres[part, 0]
        b = np.float64(tables.centres[moved, 1]) - tables.centres[part, 1]
        c = np.float64(tables.centres[moved, 2]) - tables.centres[part, 2]
        x = turned[0, 0] * a + turned[0, 1] * b + turned[0, 2] * c
        y = turned[1, 0] * a + turned[1, 1] * b + turned[1, 2] * c
        z = turned[2, 0] * a + turned[2, 1] * b + turned[2, 2] * c
        bit = _bit(
            tables.kinds[shape, other], _cell(x, per_unit), _cell(y, per_unit), _cell(z, per_unit), SIGNATURE_WORDS * 64
        )
        mask[bit >> 6] |= np.uint64(1) << np.uint64(bit & 63)


@numba.njit(cache=True)
def _lay_upon(rotations, turn, target_turn, symmetry, up, turned):
    """Write the rotation (3, 3) that takes a part to another of its type, turned by a symmetry; return False if it
    tilts.
    """
    rotation, onto = rotations[turn], rotations[target_turn]
    if up >= 0:
        level = 0.0
        for k in range(3):
            for m in range(3):
                level += onto[up, k] * symmetry[k, m] * rotation[up, m]
        if level < MIN_UPRIGHT_COSINE:
            return False
    for i in range(3):
        a = onto[i, 0] * symmetry[0, 0] + onto[i, 1] * symmetry[1, 0] + onto[i, 2] * symmetry[2, 0]
        b = onto[i, 0] * symmetry[0, 1] + onto[i, 1] * symmetry[1, 1] + onto[i, 2] * symmetry[2, 1]
        c = onto[i, 0] * symmetry[0, 2] + onto[i, 1] * symmetry[1, 2] + onto[i, 2] * symmetry[2, 2]
        for j in range(3):
            turned[i, j] = a * rotation[j, 0] + b * rotation[j, 1] + c * rotation[j, 2]
    return True


@numba.njit(cache=True)
def _shift_to(centres, part, target, turned, alignment):
    """Write the alignment (3, 4) with a rotation that takes the centroid of a part to that of another."""
    centre, target_centre = centres[part], centres[target]
    for i in range(3):
        for j in range(3):
            alignment[i, j] = turned[i, j]
        moved = alignment[i, 0] * centre[0] + alignment[i, 1] * centre[1] + alignment[i, 2] * centre[2]
        alignment[i, 3] = target_centre[i] - moved


@numba.njit(cache=True)
def _bit(kind, i, j, k, bits):
    """Return the bit of a type and a cell, of a power of two of `bits`; others may share it."""
    mixed = (kind * 73856093 + i * 19349663 + j * 83492791 + k * 49979687) * 0x9E3779B97F4A7C1
    return (mixed >> 24) & (bits - 1)


@numba.njit(cache=True)
def _occupied_cells(centres, firsts, cell, tolerance):
    """Return the bits of the cells in which a part of each shape may be met, uint64 (shapes, words)."""
    shapes = len(firsts)
    bits = 64
    while bits * shapes < BITS_PER_PART * len(centres):
        bits *= 2
    occupied = np.zeros((shapes, bits // 64), dtype=np.uint64)
    per_unit = 1.0 / cell
    gap = 1.001 * tolerance  # rounding must not take a place out of its cells
    for shape in range(shapes):
        for kind in range(firsts.shape[1] - 1):
            for part in range(firsts[shape, kind], firsts[shape, kind + 1]):
                a, b, c = np.float64(centres[part, 0]), np.float64(centres[part, 1]), np.float64(centres[part, 2])
                for i in range(_cell(a - gap, per_unit), _cell(a + gap, per_unit) + 1):
                    for j in range(_cell(b - gap, per_unit), _cell(b + gap, per_unit) + 1):
                        for k in range(_cell(c - gap, per_unit), _cell(c + gap, per_unit) + 1):
                            bit = _bit(kind, i, j, k, bits)
                            occupied[shape, bit >> 6] |= np.uint64(1) << np.uint64(bit & 63)
    return occupied


@numba.njit(cache=True)
def _cell(place, per_unit):
    return np.int64(place * per_unit + 2.0**20)  # no rounding down, which takes longer: no place is that far off


@numba.njit(cache=True)
def _meets(centres, alignment, part, low, end, tolerance):
    """Return whether a part, moved, has the centroid of one of the parts from `low` to `end`, which are sorted by x."""
    a, b, c = centres[part, 0], centres[part, 1], centres[part, 2]
    x = alignment[0, 0] * a + alignment[0, 1] * b + alignment[0, 2] * c + alignment[0, 3]
    y = alignment[1, 0] * a + alignment[1, 1] * b + alignment[1, 2] * c + alignment[1, 3]
    z = alignment[2, 0] * a + alignment[2, 1] * b + alignment[2, 2] * c + alignment[2, 3]
    high = end
    while low < high:
        middle = (low + high) // 2
        if centres[middle, 0] < x - tolerance:
            low = middle + 1
        else:
            high = middle
    while low < end and centres[low, 0] <= x + tolerance:
        if abs(centres[low, 1] - y) <= tolerance and abs(centres[low, 2] - z) <= tolerance:
            return True
        low += 1
    return False
