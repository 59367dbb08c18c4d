"""Inputs of recovery: checked clouds, and the ink of line drawings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from stages.shape.arrays import BoolArray, ByteArray, FloatArray
from stages.training.recovery.drawings import fit_to_square

MIN_CLOUD_POINTS = 32
MAX_INK_SHARE = 0.35
"""A photograph has no plain background."""
MAX_MEAN_COLOUR_DIFFERENCE = 24.0
"""Between the channels of a drawing, of 255."""
MIN_INK_CONTRAST = 40
"""Grey levels between ink and background, of 255."""


class InputError(ValueError):
    """An input that is neither a cloud nor a drawing; the message says why, and what would be one."""


@dataclass(frozen=True)
class RecoveryInput:
    """A cloud or a drawing.

    name: results are filed under it
    points: float64 (n, 3), None for a drawing
    ink: bool (side, side), fitted to a square; None for a cloud
    warnings: what its reader took for what, and left out
    """

    name: str
    points: FloatArray | None = None
    ink: BoolArray | None = None
    warnings: tuple[str, ...] = ()


def checked_cloud(points: Any, name: str = "the cloud") -> FloatArray:
    """Convert an array (n, 3) or wider to a cloud float64 (n, 3).

    Raises InputError for too few points, for numbers that are not finite and for points that all coincide.
    """
    try:
        cloud = np.asarray(points, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} holds no numbers: {error}") from error
    if cloud.size == 0:
        raise InputError(f"{name} is empty: a cloud needs at least {MIN_CLOUD_POINTS} points")
    if cloud.ndim != 2 or cloud.shape[1] < 3:
        raise InputError(f"{name} is of shape {cloud.shape}: a cloud is (points, 3)")
    cloud = np.ascontiguousarray(cloud[:, :3])
    if len(cloud) < MIN_CLOUD_POINTS:
        count = f"{len(cloud)} point{'s' if len(cloud) > 1 else ''}"
        raise InputError(f"{name} has {count}: a cloud needs at least {MIN_CLOUD_POINTS}")
    wrong = int((~np.isfinite(cloud)).any(axis=1).sum())
    if wrong:
        raise InputError(f"{name}: {wrong} of {len(cloud)} points are not finite (NaN or infinity); remove them")
    if not float(np.ptp(cloud, axis=0).max()) > 0.0:
        raise InputError(f"{name}: all {len(cloud)} points are at one place")
    return cloud


def ink_from_picture(picture: ByteArray, name: str = "the drawing") -> BoolArray:
    """Find the ink of a drawing uint8 (h, w) or (h, w, 3), dark on light or light on dark: bool (side, side), fitted.

    Raises InputError for a picture in colour, one without lines and one that is no line drawing.
    """
    if picture.ndim == 3 and picture.shape[2] >= 3:
        channels = picture[..., :3].astype(np.int16)
        if float((channels.max(axis=2) - channels.min(axis=2)).mean()) > MAX_MEAN_COLOUR_DIFFERENCE:
            raise InputError(f"{name} is a picture in colour: give a drawing, lines on a plain background")
        picture = channels.mean(axis=2).astype(np.uint8)
    if picture.ndim != 2 or not picture.size:
        raise InputError(f"{name} is of shape {picture.shape}: a drawing is (height, width)")
    grey = picture.astype(np.int16)
    contrast = np.abs(grey - int(np.median(grey)))
    strongest = int(contrast.max())
    if strongest < MIN_INK_CONTRAST:
        raise InputError(f"{name} is blank: no line differs from its background")
    ink: BoolArray = contrast > max(strongest // 2, MIN_INK_CONTRAST // 2)
    ink_share = float((contrast > MIN_INK_CONTRAST).mean())
    if ink_share > MAX_INK_SHARE:
        raise InputError(
            f"{name} is a photograph, or shaded: {ink_share:.0%} of it is no background; give a line drawing"
        )
    return fit_to_square(ink)
