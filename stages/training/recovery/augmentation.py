"""Augmentation on the device of the network: other points and other ink of the same shapes at each step.

A share of the inputs is corrupted as scans and hand drawings are.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import torch
from torch import Generator, Tensor
from torch.nn.functional import max_pool2d

from stages.shape.arrays import FloatArray
from stages.training.recovery.clouds import frame_of
from stages.training.recovery.drawings import DRAWING_SIDE_PIXELS

QUANTIZATION_STEPS = 65_534
"""Of the side of a box."""
MAX_NOISE_DEVIATION = 0.015
"""In sides of the box around a shape."""
MIN_PARTIAL_SHARE = 0.5
"""Share of the points that a partial cloud keeps at least."""
MIN_DENSITY = 0.15
"""At the sparse end of a cloud of varying density."""
KEPT_INK_SHARE = 0.9
"""Of a thinned drawing."""


def quantized_cloud(cloud: FloatArray) -> npt.NDArray[np.int16]:
    """A cloud (n, 3) in its frame, int16."""
    return np.rint(frame_of(cloud).normalized(cloud) * QUANTIZATION_STEPS).astype(np.int16)


def augment_clouds(clouds: Tensor, points: int, share: float, noise: Generator) -> Tensor:
    """Draw `points` points of each quantized cloud int16 (n, m, 3), float (n, points, 3) in their frames.

    A `share` of the clouds is corrupted in one to three ways: noise, varying density, one side missing. Where fewer
    points are left, they are repeated.
    """
    n, m, _ = clouds.shape
    device = clouds.device

    def uniform(*size: int) -> Tensor:
        return torch.rand(size, generator=noise, device=device)

    corrupted = uniform(n, 1) < share
    kinds = torch.randint(1, 8, (n, 1), generator=noise, device=device) * corrupted
    scaled = clouds.float() / QUANTIZATION_STEPS
    deviations = MAX_NOISE_DEVIATION * uniform(n, 1, 1) * ((kinds & 1) > 0)[..., None]
    scaled = scaled + deviations * torch.randn(scaled.shape, generator=noise, device=device)
    direction = torch.randn((n, 1, 3), generator=noise, device=device)
    along = (scaled * direction).sum(dim=-1)
    start, end = along.amin(dim=1, keepdim=True), along.amax(dim=1, keepdim=True)
    positions = (along - start) / (end - start).clamp(min=1e-9)
    sparse = ((kinds & 2) > 0) & (uniform(n, m) >= MIN_DENSITY + (1.0 - MIN_DENSITY) * positions)
    cut = (uniform(n, 1) * (1.0 - MIN_PARTIAL_SHARE) * (m - 1)).long()
    missing = ((kinds & 4) > 0) & (along < along.sort(dim=1).values.gather(1, cut))
    lost = sparse | missing
    order = (uniform(n, m) + 2.0 * lost).sort(dim=1, stable=True).indices
    left = (~lost).sum(dim=1, keepdim=True).clamp(min=1)
    chosen = order.gather(1, torch.arange(points, device=device) % left)
    drawn = scaled.gather(1, chosen[..., None].expand(-1, -1, 3))
    low, high = drawn.amin(dim=1, keepdim=True), drawn.amax(dim=1, keepdim=True)
    size = (high - low).amax(dim=-1, keepdim=True)
    return (drawn - (low + high) / 2.0) / torch.where(size > 0.0, size, 1.0)


def unpack_drawings(bits: Tensor) -> Tensor:
    """Drawings float (n, 1, side, side), ink 1 on 0, from their bits uint8 (n, bytes)."""
    shifts = torch.arange(7, -1, -1, dtype=torch.uint8, device=bits.device)
    ink = (bits[..., None] >> shifts) & 1
    return ink.view(len(bits), 1, DRAWING_SIDE_PIXELS, DRAWING_SIDE_PIXELS).float()


def augment_drawings(bits: Tensor, share: float, rng: np.random.Generator, noise: Generator) -> Tensor:
    """Drawings float (n, 1, side, side) from bits uint8 (n, bytes).

    Half of a `share` is mirrored; half of a share has thick lines, the other half thin ones.
    """
    drawings = unpack_drawings(bits)
    mirrored, morphology = rng.random((2, len(bits)))
    (rows,) = np.nonzero(mirrored < 0.5 * share)
    drawings[rows] = drawings[rows].flip(-1)
    (rows,) = np.nonzero(morphology < 0.5 * share)
    drawings[rows] = max_pool2d(drawings[rows], 3, 1, 1)
    (rows,) = np.nonzero((morphology >= 0.5 * share) & (morphology < share))
    size = (len(rows), 1, DRAWING_SIDE_PIXELS, DRAWING_SIDE_PIXELS)
    kept = torch.rand(size, generator=noise, device=bits.device) < KEPT_INK_SHARE
    drawings[rows] = drawings[rows] * kept
    return drawings
