"""Turn the placements of a scene into parts with rigid poses; scale, shear and mirroring move into the surfaces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline.errors import ConfigError
from stages.exemplars.model import RawPart
from stages.model_files.scene import ModelScene, Placement, Surface, UniqueNames
from stages.shape.arrays import FloatArray

STRETCH_TOLERANCE = 1e-5
"""Relative difference up to which stretches are equal: 32-bit matrices differ in their last digits."""
MIN_DIAGONAL, MAX_DIAGONAL = 1e-9, 1e9
"""Diagonals, in units, between which areas and their squares are in the range of floats."""
MAX_ORIGIN_DISTANCE = 1e3
"""Distance from the origin, in diagonals of the model, beyond which a model is moved there."""
MAX_SPACING_SHARE = 1e-3
"""Spacing of 32-bit floats, as a share of the median part's diagonal, from which contacts may be lost."""


def rigid_parts(path: Path, scene: ModelScene) -> tuple[tuple[RawPart, ...], list[str]]:
    """Return the parts of a scene with one placement for each part, and warnings.

    Poses are rigid, part coordinates start in the middle of the part's box, and a model far from the origin is moved
    there. Raises ConfigError for a model that is too small or too large.
    """
    surfaces, placements = bake_stretch(*_centre(scene.surfaces, scene.placements))
    offset, warnings = _offset_from_origin(path, surfaces, placements)
    names = UniqueNames()
    parts = []
    for placement in placements:
        surface = surfaces[placement.surface]
        pose = placement.pose.copy()
        pose[:3, 3] -= offset
        parts.append(
            RawPart(
                names(placement.name),
                surface.name,
                placement.label,
                pose,
                surface.vertices,
                surface.faces,
                surface.face_colors,
                surface.appearance,
                placement.node,
            )
        )
    return tuple(parts), warnings


def _centre(surfaces: Sequence[Surface], placements: Sequence[Placement]) -> tuple[list[Surface], list[Placement]]:
    """Return the same scene with the origin of each surface in the middle of its box."""
    middles = [(surface.vertices.min(axis=0) + surface.vertices.max(axis=0)) / 2 for surface in surfaces]
    moved = []
    for placement in placements:
        pose = placement.pose.copy()
        pose[:3, 3] += pose[:3, :3] @ middles[placement.surface]
        moved.append(replace(placement, pose=pose))
    centred = [
        replace(surface, vertices=surface.vertices - middle) for surface, middle in zip(surfaces, middles, strict=True)
    ]
    return centred, moved


def bake_stretch(surfaces: Sequence[Surface], placements: Sequence[Placement]) -> tuple[list[Surface], list[Placement]]:
    """Return the same scene with rigid poses of determinant +1.

    Placements of one surface with the same stretch still share a surface. The name of a stretched or mirrored surface
    ends with its stretch (`wall@mirror`, `wall@0.75`). Names of surfaces become unique.
    """
    baked: list[Surface] = []
    placed: list[Placement] = []
    variants: dict[int, list[tuple[FloatArray, int]]] = {}
    names = UniqueNames()
    for placement in placements:
        rotation, stretch = _polar(placement.pose[:3, :3])
        known = variants.setdefault(placement.surface, [])
        index = next((number for other, number in known if _is_same_stretch(other, stretch)), None)
        if index is None:
            index = len(baked)
            known.append((stretch, index))
            baked.append(_stretched(surfaces[placement.surface], stretch, names))
        pose = np.eye(4)
        pose[:3, :3] = rotation
        pose[:3, 3] = placement.pose[:3, 3]
        placed.append(replace(placement, surface=index, pose=pose))
    return baked, placed


def _offset_from_origin(
    path: Path, surfaces: list[Surface], placements: list[Placement]
) -> tuple[FloatArray, list[str]]:
    """Return what to subtract from all poses, float64 (3,), with a warning if it is not zero."""
    middle, diagonal = _box(surfaces, placements)
    if 0 < diagonal < MIN_DIAGONAL or diagonal > MAX_DIAGONAL:
        raise ConfigError(
            f"{path}: the model is {diagonal:.2g} units across, and only sizes from {MIN_DIAGONAL:g} to "
            f"{MAX_DIAGONAL:g} can be computed with; scale it in the modelling tool, to metres say, and export it again"
        )
    distance = float(np.linalg.norm(middle))
    if distance <= MAX_ORIGIN_DISTANCE * diagonal:
        return np.zeros(3), []
    spacing = float(np.spacing(np.float32(np.abs(middle).max())))
    diagonals = [
        float(np.linalg.norm(np.ptp(surfaces[placement.surface].vertices, axis=0))) for placement in placements
    ]
    share = spacing / (float(np.median(diagonals)) or 1.0)
    loses_contacts = share > MAX_SPACING_SHARE
    advice = "; contacts may be lost, move it to the origin before the export" if loses_contacts else ""
    warning = (
        f"the model is {distance:.4g} units from the origin and is moved there; 32-bit floats are {spacing:.2g} "
        f"units apart at that distance, {share:.2g} of the median part{advice}"
    )
    return middle, [warning]


def _box(surfaces: Sequence[Surface], placements: Sequence[Placement]) -> tuple[FloatArray, float]:
    """Return the middle of the box around a scene with rigid poses, float64 (3,), and the length of its diagonal."""
    halves = np.array([np.abs(surfaces[placement.surface].vertices).max(axis=0) for placement in placements])
    poses = np.array([placement.pose for placement in placements])
    reach = np.einsum("nij,nj->ni", np.abs(poses[:, :3, :3]), halves)
    low, high = (poses[:, :3, 3] - reach).min(axis=0), (poses[:, :3, 3] + reach).max(axis=0)
    return (low + high) / 2, float(np.linalg.norm(high - low))


def _polar(matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return rotation and stretch with `matrix = rotation @ stretch`; a mirroring matrix has a negative stretch.

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


def _is_same_stretch(first: FloatArray, second: FloatArray) -> bool:
    return bool(np.abs(first - second).max() <= STRETCH_TOLERANCE * np.abs(first).max())


def _stretched(surface: Surface, stretch: FloatArray, names: UniqueNames) -> Surface:
    """Return the surface under a linear map, with its faces reversed if that mirrors, under a new name."""
    factors = np.diag(stretch)
    mirrored = np.linalg.det(stretch) < 0
    words = ["mirror"] if mirrored else []
    if np.count_nonzero(stretch - np.diag(factors)):
        words.append("shear")
    elif np.ptp(factors):
        words.append("x".join(f"{abs(factor):g}" for factor in factors))
    elif abs(factors[0]) != 1.0:
        words.append(f"{abs(factors[0]):g}")
    look = surface.appearance
    if look is not None and words:
        look = look.turned(stretch).mirrored() if mirrored else look.turned(stretch)
    stem = surface.name + ("@" + ",".join(words) if words else "")
    return replace(
        surface,
        name=names(stem),
        vertices=surface.vertices @ stretch.T if words else surface.vertices,
        faces=np.ascontiguousarray(surface.faces[:, ::-1]) if mirrored else surface.faces,
        appearance=look,
    )
