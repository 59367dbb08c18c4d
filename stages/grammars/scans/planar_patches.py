"""Planar patches of a point cloud, which stand for the faces of a mesh (symmetry §4)."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from stages.grammars.scans.outward_normals import outward_signs
from stages.grammars.scans.point_neighbourhoods import PointNeighbourhoods, patch_contacts
from stages.shape.arrays import BoolArray, FloatArray, IntArray

MAX_TILT_RADIANS = 0.4
"""Largest angle between a patch and the plane of a neighbourhood, which rests on few, noisy points."""
PLANE_NOISE = 3.0
"""Standard deviations of the noise up to which a point lies on a plane."""
MIN_PATCH_POINTS = 12
MIN_WIDTH_SHARE = 0.5
"""A patch that is narrower, as a share of the reach of neighbourhoods, is noise at a crease."""
EXPLAINED_SHARE = 0.8
"""A patch is also noise if more of it lies in the planes of larger patches that it meets."""
SAME_PLANE_RADIANS = 0.1
"""Patches that meet at a smaller angle are merged."""
REFINEMENT_ROUNDS = 3


@dataclass(frozen=True)
class PlanarPatches:
    """Planar patches of n points.

    of: int32 (n,), the patch of each point, -1 for none
    middles: float64 (m, 3)
    normals: float64 (m, 3), outward
    """

    of: IntArray
    middles: FloatArray
    normals: FloatArray

    def projected(self, points: FloatArray) -> FloatArray:
        """Project points (n, 3) onto the planes of their patches; points of no patch stay."""
        projected = points.copy()
        held = self.of >= 0
        normals = self.normals[self.of[held]]
        off = ((points[held] - self.middles[self.of[held]]) * normals).sum(axis=1)
        projected[held] -= off[:, None] * normals
        return projected


def planar_patches(
    points: FloatArray, around: PointNeighbourhoods, min_distance: float, given: FloatArray | None
) -> PlanarPatches:
    """Grow planar patches of points (n, 3) from where they are flattest (Rabbani and others 2006).

    min_distance: distance up to which points lie on a plane, however little noise there is
    given: float64 (n, 3), outward normals of the points; without them patches that meet agree, and most of the surface
        faces away from its middle
    """
    distance = max(min_distance, PLANE_NOISE * around.noise)
    order = np.argsort(around.roughness, kind="stable")
    seeds = order[~around.outlier[order]]
    of = _numbered(_grown(points, around.normals, around.near, seeds, np.cos(MAX_TILT_RADIANS), distance))
    min_width = MIN_WIDTH_SHARE * float(np.median(around.reach))
    for _ in range(REFINEMENT_ROUNDS):
        middles, normals, _ = _fitted(points, of)
        of = _numbered(_merged(points, around.near, of, middles, normals, distance))
        middles, normals, widths = _fitted(points, of)
        noise = (widths < min_width) | _explained(points, around.near, of, middles, normals, distance)
        of[noise[of]] = -1
        of = _numbered(_reassigned(points, around.near, of, middles, normals, distance, around.outlier))
    middles, normals, _ = _fitted(points, of)
    signs = outward_signs(points, around.near, of, middles, normals, given)
    return PlanarPatches(of, middles, normals * signs[:, None])


@numba.njit(cache=True)
def _grown(points, normals, near, seeds, min_cosine, distance):
    """Return the patch of each point, int32 (n,), -1 for none: from each seed on, what lies on one plane."""
    patch = np.full(len(points), -1, dtype=np.int32)
    queue = np.empty(len(points), dtype=np.int64)
    count = 0
    for seed in seeds:
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
                if abs(cosine) < min_cosine or abs(off) > distance:
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
    """Return the middle of chosen points and the normal of the plane through them."""
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
    """Number patches by size, the largest first; drop those of fewer than MIN_PATCH_POINTS points."""
    count = np.bincount(of[of >= 0])
    order = np.argsort(-count, kind="stable")
    number = np.full(len(count) + 1, -1, dtype=np.int32)
    number[order] = np.where(count[order] >= MIN_PATCH_POINTS, np.arange(len(order)), -1)
    return number[of]


def _fitted(points: FloatArray, of: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Fit planes to patches.

    Returns middles (m, 3), normals (m, 3) of either sign, and the width of each patch, float64 (m,): the standard
    deviation of its points in the second direction.
    """
    held = np.flatnonzero(of >= 0)
    patch, total = of[held], int(of.max(initial=-1)) + 1
    count = np.bincount(patch, minlength=total)[:, None]
    middles = np.column_stack([np.bincount(patch, points[held, d], total) for d in range(3)]) / count
    offsets = points[held] - middles[patch]
    spread = np.empty((total, 3, 3))
    for i in range(3):
        for j in range(3):
            spread[:, i, j] = np.bincount(patch, offsets[:, i] * offsets[:, j], total)
    values, axes = np.linalg.eigh(spread / count[:, :, None])
    return middles, axes[:, :, 0], np.sqrt(np.maximum(values[:, 1], 0))


def _merged(
    points: FloatArray, near: IntArray, of: IntArray, middles: FloatArray, normals: FloatArray, distance: float
) -> IntArray:
    """Merge patches that meet in one plane."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    one, other = patch_contacts(near, of)
    pairs, pair = np.unique(np.column_stack([of[one], of[other]]), axis=0, return_inverse=True)
    first, second = pairs.T
    off = np.abs(((points[one] - middles[of[other]]) * normals[of[other]]).sum(axis=1))
    mean = np.bincount(pair.reshape(-1), off, len(pairs)) / np.bincount(pair.reshape(-1), minlength=len(pairs))
    level = np.abs((normals[first] * normals[second]).sum(axis=1)) > np.cos(SAME_PLANE_RADIANS)
    whole = np.abs(((middles[first] - middles[second]) * normals[second]).sum(axis=1)) < distance
    same = level & whole & (mean < distance / 2)
    total = len(middles)
    graph = coo_array((same[same], (first[same], second[same])), shape=(total, total))
    _, label = connected_components(graph, directed=True, connection="strong")
    return np.where(of >= 0, label[of], -1).astype(np.int32)


def _explained(
    points: FloatArray, near: IntArray, of: IntArray, middles: FloatArray, normals: FloatArray, distance: float
) -> BoolArray:
    """Return which patches lie in the planes of larger ones that they meet, bool (m,): noise along creases."""
    one, other = patch_contacts(near, of)
    pairs = np.unique(np.column_stack([of[one], of[other]]), axis=0)
    order = np.argsort(of, kind="stable")
    members = np.split(order, np.searchsorted(of[order], np.arange(len(middles) + 1)))[1:-1]
    explained = np.zeros(len(middles), dtype=bool)
    larger = pairs[pairs[:, 1] < pairs[:, 0]]
    for patch in np.unique(larger[:, 0]).tolist():
        met = larger[larger[:, 0] == patch, 1]
        offsets = points[members[patch], None] - middles[met]
        off = np.abs((offsets * normals[met]).sum(axis=2)).min(axis=1)
        explained[patch] = (off < distance).mean() > EXPLAINED_SHARE
    return explained


@numba.njit(cache=True)
def _reassigned(points, near, of, middles, normals, distance, outlier):
    """Return the best patch of each point among those of its neighbours, by distance from the plane; -1 for none."""
    assigned = of.copy()
    for n in range(len(points)):
        if outlier[n]:
            assigned[n] = -1
            continue
        best, patch = distance, -1
        for other in near[n]:
            candidate = of[other]
            if candidate < 0 or candidate == patch:
                continue
            off = 0.0
            for d in range(3):
                off += (points[n, d] - middles[candidate, d]) * normals[candidate, d]
            if abs(off) < best:
                best, patch = abs(off), candidate
        assigned[n] = patch
    return assigned
