"""Finding the boundary of a piece in another shape, and the docking transform (strings §4)."""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.geometry.pose_kernels import apply_transform, looks_same, part_at, rotate
from stages.variations.kernels.outcomes import Outcome
from stages.variations.kernels.random_choice import random_below
from stages.variations.kernels.structs import MIN_UPRIGHT_COSINE, N_BOUNDARY, N_PARTS


@numba.njit(cache=True)
def _transform_between(rotation, translation, symmetry, onto_rotation, onto_translation, out):
    """Write the transform that takes a part's pose, by one of its symmetries, to another pose into `out`."""
    for i in range(3):
        x, y, z = 0.0, 0.0, 0.0
        for k in range(3):
            x += onto_rotation[i, k] * symmetry[k, 0]
            y += onto_rotation[i, k] * symmetry[k, 1]
            z += onto_rotation[i, k] * symmetry[k, 2]
        for j in range(3):
            out[i, j] = 0.0 + x * rotation[j, 0] + y * rotation[j, 1] + z * rotation[j, 2]
    for i in range(3):
        out[3, i] = onto_translation[i]
        for j in range(3):
            out[3, i] -= out[i, j] * translation[j]


@numba.njit(cache=True)
def _fit_transform(kit, a, b, ws):
    """Refit the docking transform to the whole boundary by least squares, without changing handedness (strings §4).

    It uses the SVD of their covariance. Each part counts with its centroid and its three axes, so one boundary part, or
    a row of them, determines the transform too.
    """
    count = ws.counts[N_BOUNDARY]
    centre_a, centre_b = np.zeros(3), np.zeros(3)
    for k in range(count):
        for i in range(3):
            centre_a[i] += a.translations[ws.boundary[k], i] / count
            centre_b[i] += b.translations[ws.images[k], i] / count
    covariance = np.zeros((3, 3))
    rotation, target = np.empty((3, 3)), np.empty((3, 3))
    for k in range(count):
        part, image = ws.boundary[k], ws.images[k]
        part_type = a.types[part]
        rotate(ws.transform, a.rotations[part], rotation)
        symmetry = looks_same(kit, part_type, rotation, b.rotations[image])
        weight = kit.reach[part_type] ** 2 / 3.0
        for i in range(3):
            for j in range(3):
                x = 0.0
                for axis in range(3):
                    x += b.rotations[image, i, axis] * kit.symmetries[symmetry, axis, j]
                target[i, j] = x
        for i in range(3):
            for j in range(3):
                x = (a.translations[part, i] - centre_a[i]) * (b.translations[image, j] - centre_b[j])
                for axis in range(3):
                    x += weight * a.rotations[part, i, axis] * target[j, axis]
                covariance[i, j] += x
    u, _, vt = np.linalg.svd(covariance)
    old = ws.transform[:3]
    handed = np.linalg.det(old) * np.linalg.det(u) * np.linalg.det(vt)
    for i in range(3):
        for j in range(3):
            x = vt[0, i] * u[j, 0] + vt[1, i] * u[j, 1]
            ws.transform[i, j] = x + (vt[2, i] * u[j, 2] if handed > 0 else -vt[2, i] * u[j, 2])
    for i in range(3):
        ws.transform[3, i] = centre_b[i]
        for j in range(3):
            ws.transform[3, i] -= ws.transform[i, j] * centre_a[j]


@numba.njit(cache=True)
def match_poses(rng, kit, a, b, same_shape, ws):
    """Find the boundary of the piece in B by the poses of its parts modulo symmetry, from the rarest type on.

    Images go to `ws.images`, the docking transform to `ws.transform`. The first match in random order counts.
    """
    anchor = ws.boundary[0]
    anchor_type = a.types[anchor]
    count = b.type_starts[anchor_type + 1] - b.type_starts[anchor_type]
    first = kit.symmetry_starts[anchor_type]
    symmetries = kit.symmetry_starts[anchor_type + 1] - first
    offset = random_below(rng, count * symmetries)
    transform = ws.transform
    point, rotation = np.empty(3), np.empty((3, 3))
    for step in range(count * symmetries):
        choice = (offset + step) % (count * symmetries)
        image = b.by_type[b.type_starts[anchor_type] + choice // symmetries]
        if same_shape and image == anchor and choice % symmetries == 0:
            continue
        _transform_between(
            a.rotations[anchor], a.translations[anchor], kit.symmetries[first + choice % symmetries],
            b.rotations[image], b.translations[image], transform,
        )  # fmt: skip
        if kit.up >= 0 and transform[kit.up, kit.up] < MIN_UPRIGHT_COSINE:
            continue
        ws.images[0] = image
        matched = True
        for k in range(1, ws.counts[N_BOUNDARY]):
            part = ws.boundary[k]
            part_type = a.types[part]
            low, high = b.type_starts[part_type], b.type_starts[part_type + 1]
            apply_transform(transform, a.translations[part], point)
            at = part_at(b.translations, b.by_type, low, high, point, kit.limits[0])
            if at < 0:
                matched = False
                break
            rotate(transform, a.rotations[part], rotation)
            if looks_same(kit, part_type, rotation, b.rotations[at]) < 0:
                matched = False
                break
            ws.images[k] = at
        if matched:
            _fit_transform(kit, a, b, ws)
            return Outcome.OK
    return Outcome.NO_MATCH


@numba.njit(cache=True)
def lies_in(kit, ws, b):
    """Return whether the variant is only a piece of B: each part coincides with one of B under one rigid transform."""
    n = ws.counts[N_PARTS]
    if n > len(b.types):
        return False
    anchor, smallest = 0, 1 << 30
    for v in range(n):
        present = b.type_starts[ws.types[v] + 1] - b.type_starts[ws.types[v]]
        if present == 0:
            return False
        if present < smallest:
            anchor, smallest = v, present
    anchor_type = ws.types[anchor]
    point, rotation, transform = np.empty(3), np.empty((3, 3)), np.empty((4, 3))
    for at in range(b.type_starts[anchor_type], b.type_starts[anchor_type + 1]):
        image = b.by_type[at]
        for symmetry in range(kit.symmetry_starts[anchor_type], kit.symmetry_starts[anchor_type + 1]):
            _transform_between(
                ws.rotations[anchor], ws.translations[anchor], kit.symmetries[symmetry],
                b.rotations[image], b.translations[image], transform,
            )  # fmt: skip
            inside = True
            for v in range(n):
                part_type = ws.types[v]
                first, last = b.type_starts[part_type], b.type_starts[part_type + 1]
                apply_transform(transform, ws.translations[v], point)
                found = part_at(b.translations, b.by_type, first, last, point, kit.limits[0])
                if found >= 0:
                    rotate(transform, ws.rotations[v], rotation)
                if found < 0 or looks_same(kit, part_type, rotation, b.rotations[found]) < 0:
                    inside = False
                    break
            if inside:
                return True
    return False
