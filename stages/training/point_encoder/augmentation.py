"""Augmentation of clouds with parts while a network learns: other shapes of the same structure at each step."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import numpy.typing as npt

from stages.shape.arrays import FloatArray
from stages.training.point_encoder.settings import Augmentation

PartIds = npt.NDArray[np.int32]

STRETCH_LOG_STD = 0.25
"""Of the factor along each axis."""
JITTER_LOG_STD = 0.12
"""Of the factor of each part along each axis, about the middle of the part."""
JITTER_SHIFT_STD = 0.02
"""Of the shift of each part, in diagonals of the shape."""
MAX_NOISE_STD = 0.01
"""Noise of a cloud has a standard deviation between 0 and this, in diagonals of the shape."""
MIN_PARTIAL_SHARE = 0.5
"""A partial cloud keeps between this share of the points and all."""


def augmented_cloud(
    cloud: npt.NDArray[np.float32], parts: PartIds, ways: Collection[Augmentation], rng: np.random.Generator
) -> tuple[npt.NDArray[np.float32], PartIds]:
    """Augment one cloud float32 (n, 3) with the part of each point int32 (n,), and scale it to diagonal 1 again.

    `turn`: by any angle about the up axis. `stretch`: by log-normal factors along the axes. `jitter`: each part is
    scaled along the axes about its middle and moved. `partial`: the points beyond a plane of random direction are
    replaced by copies of the others. `noise`: Gaussian. Of each cloud every way is drawn afresh.
    """
    points: FloatArray = cloud.astype(np.float64)
    if "turn" in ways:
        points = points @ _turn(rng.uniform(0.0, 2.0 * np.pi)).T
    if "stretch" in ways:
        points = points * np.exp(rng.normal(0.0, STRETCH_LOG_STD, 3))
    if "jitter" in ways:
        points = _jittered(points, parts, rng)
    if "partial" in ways:
        kept = _seen_from_one_side(points, rng)
        points, parts = points[kept], parts[kept]
    if "noise" in ways:
        points = points + rng.normal(0.0, rng.uniform(0.0, MAX_NOISE_STD), points.shape)
    low, high = points.min(axis=0), points.max(axis=0)
    diagonal = float(np.linalg.norm(high - low)) or 1.0
    return ((points - (low + high) / 2.0) / diagonal).astype(np.float32), parts


def _turn(angle: float) -> FloatArray:
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])


def _jittered(points: FloatArray, parts: PartIds, rng: np.random.Generator) -> FloatArray:
    _, part = np.unique(parts, return_inverse=True)
    counts = np.bincount(part)[:, None]
    middles = np.stack([np.bincount(part, points[:, axis]) for axis in range(3)], axis=1) / counts
    factors = np.exp(rng.normal(0.0, JITTER_LOG_STD, middles.shape))
    shifts = rng.normal(0.0, JITTER_SHIFT_STD, middles.shape)
    jittered: FloatArray = (points - middles[part]) * factors[part] + (middles + shifts)[part]
    return jittered


def _seen_from_one_side(points: FloatArray, rng: np.random.Generator) -> npt.NDArray[np.intp]:
    """Return indices of as many points as there are, of those on one side of a plane."""
    along = points @ rng.normal(size=3)
    kept = np.argsort(along, kind="stable")[: round(rng.uniform(MIN_PARTIAL_SHARE, 1.0) * len(points))]
    return np.concatenate([kept, rng.choice(kept, len(points) - len(kept))])
