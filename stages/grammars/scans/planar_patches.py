"""Planar patches of a point cloud: what stands for the faces of a mesh (symmetry §4)."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from stages.grammars.scans.outward_normals import outward_signs
from stages.grammars.scans.point_neighbourhoods import PointNeighbourhoods, patch_contacts
from stages.shape.arrays import BoolArray, FloatArray, IntArray

TILT = 0.4
"""Radians that normals of neighbourhoods may differ from that of a patch: they are those of few points, with noise."""
SPREAD = 3.0
"""Standard deviations of the noise up to which a point lies on a plane."""
FEWEST = 12
"""Points of a patch."""
NARROW = 0.5
"""A patch whose points are spread less across it, as a share of how far neighbourhoods reach, is noise at a crease."""
EXPLAINED = 0.8
"""So is one of which this share lies in the planes of larger ones that it meets."""
FLAT = 0.1
"""Radians between patches that meet and are one."""
ROUNDS = 3
"""So often points beside another patch go to where they fit best."""


@dataclass(frozen=True)
class PlanarPatches:
    """Planar patches of n points: `of`, int32 (n,), the patch of each, -1 for none; middles and outward normals of
    their planes, float64 (m, 3) each."""

    of: IntArray
    middles: FloatArray
    normals: FloatArray

    def projected(self, points: FloatArray) -> FloatArray:
        """Points (n, 3) on the planes of their patches; those of none where they are."""
        found = points.copy()
        held = self.of >= 0
        normals = self.normals[self.of[held]]
        off = ((points[held] - self.middles[self.of[held]]) * normals).sum(axis=1)
        found[held] -= off[:, None] * normals
        return found


def planar_patches(
    points: FloatArray, around: PointNeighbourhoods, least: float, given: FloatArray | None
) -> PlanarPatches:
    """The planar patches of points (n, 3), grown from where they are flattest (Rabbani and others 2006).

    least: how far from a plane points may be at least, however little noise there is. given: outward normals of the
    points, float64 (n, 3); without, normals are outward as patches that meet agree, and as most of the surface faces
    away from its middle.
    """
    most = max(least, SPREAD * around.noise)
    order = np.argsort(around.rough, kind="stable")
    of = _grown(points, around.normals, around.near, order[~around.lonely[order]], np.cos(TILT), most)
    narrow = NARROW * float(np.median(around.reach))
    of = _numbered(of)
    for _ in range(ROUNDS):
        middles, normals, _ = _fitted(points, of)
        of = _numbered(_merged(points, around.near, of, middles, normals, most))
        middles, normals, widths = _fitted(points, of)
        noise = (widths < narrow) | _explained(points, around.near, of, middles, normals, most)
        of[noise[of]] = -1
        of = _numbered(_settled(points, around.near, of, middles, normals, most, around.lonely))
    middles, normals, _ = _fitted(points, of)
    return PlanarPatches(
        of, middles, normals * outward_signs(points, around.near, of, middles, normals, given)[:, None]
    )


@numba.njit(cache=True)
def _grown(points, normals, near, order, level, most):
    """The patch of each point, int32 (n,): from each seed in `order` on, what lies on one plane; -1 for none."""
    patch = np.full(len(points), -1, dtype=np.int32)
    queue = np.empty(len(points), dtype=np.int64)
    count = 0
    for seed in order:
        if patch[seed] >= 0:
            continue
        normal, middle = normals[seed].copy(), np.zeros(3)
        for other in near[seed]:
            middle += points[other] / near.shape[1]
        patch[seed], queue[0] = count, seed
        head, tail, fitted = 0, 1, near.shape[1]
        while head < tail:
            n = queue[head]
            head += 1
            for other in near[n]:
                if patch[other] >= 0:
                    continue
                cosine, off = 0.0, 0.0
                for d in range(3):
                    cosine += normals[other, d] * normal[d]
                    off += (points[other, d] - middle[d]) * normal[d]
                if abs(cosine) < level or abs(off) > most:
                    continue
                patch[other] = count
                queue[tail] = other
                tail += 1
                if tail >= 2 * fitted:
                    fitted = tail
                    middle, normal = _plane(points, queue[:tail])
        count += 1
    return patch


@numba.njit(cache=True)
def _plane(points, chosen):
    """The middle of chosen points and the normal of the plane through them."""
    middle, spread = np.zeros(3), np.zeros((3, 3))
    for n in chosen:
        middle += points[n]
    middle /= len(chosen)
    for n in chosen:
        for i in range(3):
            for j in range(3):
                spread[i, j] += (points[n, i] - middle[i]) * (points[n, j] - middle[j])
    return middle, np.ascontiguousarray(np.linalg.eigh(spread)[1][:, 0])


def _numbered(of: IntArray) -> IntArray:
    """Patches of at least FEWEST points, numbered from 0 on, the largest first; the others are none."""
    count = np.bincount(of[of >= 0])
    order = np.argsort(-count, kind="stable")
    number = np.full(len(count) + 1, -1, dtype=np.int32)
    number[order] = np.where(count[order] >= FEWEST, np.arange(len(order)), -1)
    return number[of]


def _fitted(points: FloatArray, of: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The middles (m, 3) and normals (m, 3), of either sign, of the planes through the points of each patch, and the
    standard deviation of its points across it, float64 (m,)."""
    held = np.flatnonzero(of >= 0)
    patch, total = of[held], int(of.max(initial=-1)) + 1
    count = np.bincount(patch, minlength=total)[:, None]
    middles = np.column_stack([np.bincount(patch, points[held, d], total) for d in range(3)]) / count
    apart = points[held] - middles[patch]
    spread = np.empty((total, 3, 3))
    for i in range(3):
        for j in range(3):
            spread[:, i, j] = np.bincount(patch, apart[:, i] * apart[:, j], total)
    values, ways = np.linalg.eigh(spread / count[:, :, None])
    return middles, ways[:, :, 0], np.sqrt(np.maximum(values[:, 1], 0))


def _merged(
    points: FloatArray, near: IntArray, of: IntArray, middles: FloatArray, normals: FloatArray, most: float
) -> IntArray:
    """The patches, those that meet in one plane as one."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    one, other = patch_contacts(near, of)
    pairs, place = np.unique(np.column_stack([of[one], of[other]]), axis=0, return_inverse=True)
    first, second = pairs.T
    off = np.abs(((points[one] - middles[of[other]]) * normals[of[other]]).sum(axis=1))
    mean = np.bincount(place.reshape(-1), off, len(pairs)) / np.bincount(place.reshape(-1), minlength=len(pairs))
    level = np.abs((normals[first] * normals[second]).sum(axis=1)) > np.cos(FLAT)
    whole = np.abs(((middles[first] - middles[second]) * normals[second]).sum(axis=1)) < most
    same = level & whole & (mean < most / 2)
    total = len(middles)
    graph = coo_array((same[same], (first[same], second[same])), shape=(total, total))
    _, label = connected_components(graph, directed=True, connection="strong")
    return np.where(of >= 0, label[of], -1).astype(np.int32)


def _explained(
    points: FloatArray, near: IntArray, of: IntArray, middles: FloatArray, normals: FloatArray, most: float
) -> BoolArray:
    """Which patches lie in the planes of larger ones that they meet, bool (m,): such as noise makes along creases."""
    one, other = patch_contacts(near, of)
    pairs = np.unique(np.column_stack([of[one], of[other]]), axis=0)
    order = np.argsort(of, kind="stable")
    members = np.split(order, np.searchsorted(of[order], np.arange(len(middles) + 1)))[1:-1]
    found = np.zeros(len(middles), dtype=bool)
    larger = pairs[pairs[:, 1] < pairs[:, 0]]
    for patch in np.unique(larger[:, 0]).tolist():
        beside = larger[larger[:, 0] == patch, 1]
        apart = points[members[patch], None] - middles[beside]
        off = np.abs((apart * normals[beside]).sum(axis=2)).min(axis=1)
        found[patch] = (off < most).mean() > EXPLAINED
    return found


@numba.njit(cache=True)
def _settled(points, near, of, middles, normals, most, lonely):
    """The patch of each point: of those of its neighbours the one in whose plane it lies best, -1 for none."""
    found = of.copy()
    for n in range(len(points)):
        if lonely[n]:
            found[n] = -1
            continue
        best, patch = most, -1
        for other in near[n]:
            each = of[other]
            if each < 0 or each == patch:
                continue
            off = 0.0
            for d in range(3):
                off += (points[n, d] - middles[each, d]) * normals[each, d]
            if abs(off) < best:
                best, patch = abs(off), each
        found[n] = patch
    return found
