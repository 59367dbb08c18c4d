"""Scale, shear and mirroring move from placements into surfaces, so that the pose that is left is rigid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from stages.exemplars.formats.scene import Placement, Surface, UniqueNames
from stages.shape.arrays import FloatArray

SAME_STRETCH = 1e-5
"""Stretches closer than this, relative to their size, are one: 32-bit matrices differ in their last digits."""


def centre(surfaces: Sequence[Surface], placements: Sequence[Placement]) -> tuple[list[Surface], list[Placement]]:
    """The same scene with the origin of each surface in the middle of its box, so that poses say where parts are."""
    middles = [(each.vertices.min(axis=0) + each.vertices.max(axis=0)) / 2 for each in surfaces]
    moved = []
    for placement in placements:
        pose = placement.pose.copy()
        pose[:3, 3] += pose[:3, :3] @ middles[placement.surface]
        moved.append(replace(placement, pose=pose))
    return [
        replace(each, vertices=each.vertices - middle) for each, middle in zip(surfaces, middles, strict=True)
    ], moved


def bake_stretch(surfaces: Sequence[Surface], placements: Sequence[Placement]) -> tuple[list[Surface], list[Placement]]:
    """The same scene with rigid poses of determinant +1.

    Placements of one surface with the same stretch go on sharing one surface; a surface that is stretched or
    mirrored says so behind its name (`wall@mirror`, `wall@0.75`). Names of surfaces become unique.
    """
    baked: list[Surface] = []
    placed: list[Placement] = []
    variants: dict[int, list[tuple[FloatArray, int]]] = {}
    names = UniqueNames()
    for placement in placements:
        rotation, stretch = _polar(placement.pose[:3, :3])
        known = variants.setdefault(placement.surface, [])
        index = next((place for other, place in known if _same(other, stretch)), None)
        if index is None:
            index = len(baked)
            known.append((stretch, index))
            baked.append(_stretched(surfaces[placement.surface], stretch, names))
        pose = np.eye(4)
        pose[:3, :3] = rotation
        pose[:3, 3] = placement.pose[:3, 3]
        placed.append(replace(placement, surface=index, pose=pose))
    return baked, placed


def distance_from_origin(surfaces: Sequence[Surface], placements: Sequence[Placement]) -> tuple[FloatArray, float]:
    """Middle of the box around a scene with rigid poses, float64 (3,), and the length of the box's diagonal."""
    halves = np.array([np.abs(surfaces[each.surface].vertices).max(axis=0) for each in placements])
    poses = np.array([each.pose for each in placements])
    reach = np.einsum("nij,nj->ni", np.abs(poses[:, :3, :3]), halves)
    low, high = (poses[:, :3, 3] - reach).min(axis=0), (poses[:, :3, 3] + reach).max(axis=0)
    return (low + high) / 2, float(np.linalg.norm(high - low))


def _polar(matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Rotation and stretch with `matrix = rotation @ stretch`; a matrix that mirrors has a negative stretch.

    The stretch does not depend on the plane in which a matrix mirrors, so that all mirror images of a part are one.
    It is rounded to five digits: 0.75, not 0.7500000119.
    """
    if np.abs(matrix.T @ matrix - np.eye(3)).max() < 1e-12 and np.linalg.det(matrix) > 0:
        return matrix, np.eye(3)
    u, s, vt = np.linalg.svd(matrix)
    sign = 1.0 if np.linalg.det(u @ vt) > 0 else -1.0
    stretch = sign * (vt.T * s) @ vt
    unit = 10.0 ** np.floor(np.log10(s[0]))
    return sign * (u @ vt), np.round(stretch / unit, 5) * unit + 0.0  # + 0.0 turns -0.0 into 0.0


def _same(one: FloatArray, other: FloatArray) -> bool:
    return bool(np.abs(one - other).max() <= SAME_STRETCH * np.abs(one).max())


def _stretched(surface: Surface, stretch: FloatArray, names: UniqueNames) -> Surface:
    """The surface under a linear map, with its faces turned around if that mirrors, under a new name."""
    factors = np.diag(stretch)
    mirrored = np.linalg.det(stretch) < 0
    words = ["mirror"] if mirrored else []
    if np.count_nonzero(stretch - np.diag(factors)):
        words.append("shear")
    elif np.ptp(factors):
        words.append("x".join(f"{abs(factor):g}" for factor in factors))
    elif abs(factors[0]) != 1.0:
        words.append(f"{abs(factors[0]):g}")
    stem = surface.name + ("@" + ",".join(words) if words else "")
    return replace(
        surface,
        name=names(stem),
        vertices=surface.vertices @ stretch.T if words else surface.vertices,
        faces=np.ascontiguousarray(surface.faces[:, ::-1]) if mirrored else surface.faces,
    )
