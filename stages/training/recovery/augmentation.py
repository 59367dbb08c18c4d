"""Inputs as they are learnt from: other points and other ink of the same shapes each time, spoilt as scans and hand
drawings are; many at once, on the device of the network."""

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
"""Steps of the side of a box that stored clouds are rounded to."""
MOST_NOISE = 0.015
"""Largest standard deviation of noise, in sides of the box around a shape."""
LEAST_LEFT = 0.5
"""So much of a cloud is left at least where a part of it is missing."""
LEAST_DENSE = 0.15
"""What is left where a cloud is thinnest."""
LEAST_INK = 0.9
"""What is left of a thin drawing."""


def quantized_cloud(cloud: FloatArray) -> npt.NDArray[np.int16]:
    """A cloud (n, 3) in its frame, int16."""
    return np.rint(frame_of(cloud).normalized(cloud) * QUANTIZATION_STEPS).astype(np.int16)


def augment_clouds(clouds: Tensor, points: int, share: float, noise: Generator) -> Tensor:
    """Clouds float (n, points, 3) in their frames, at_random: `quantized_cloud` ones int16 (n, m, 3). A `share` is
    as a bad scanner would see it: with noise, denser on one side, or without one side; at least one of them. Where
    fewer points are left, they come again."""
    n, m, _ = clouds.shape
    device = clouds.device

    def chance(*size: int) -> Tensor:
        return torch.rand(size, generator=noise, device=device)

    spoilt = chance(n, 1) < share
    kinds = torch.randint(1, 8, (n, 1), generator=noise, device=device) * spoilt
    found = clouds.float() / QUANTIZATION_STEPS
    rough = MOST_NOISE * chance(n, 1, 1) * ((kinds & 1) > 0)[..., None]
    found = found + rough * torch.randn(found.shape, generator=noise, device=device)
    direction = torch.randn((n, 1, 3), generator=noise, device=device)
    along = (found * direction).sum(dim=-1)
    least, most = along.amin(dim=1, keepdim=True), along.amax(dim=1, keepdim=True)
    ranks = (along - least) / (most - least).clamp(min=1e-9)
    thin = ((kinds & 2) > 0) & (chance(n, m) >= LEAST_DENSE + (1.0 - LEAST_DENSE) * ranks)
    border = (chance(n, 1) * (1.0 - LEAST_LEFT) * (m - 1)).long()
    torn = ((kinds & 4) > 0) & (along < along.sort(dim=1).values.gather(1, border))
    lost = thin | torn
    order = (chance(n, m) + 2.0 * lost).sort(dim=1, stable=True).indices
    left = (~lost).sum(dim=1, keepdim=True).clamp(min=1)
    chosen = order.gather(1, torch.arange(points, device=device) % left)
    found = found.gather(1, chosen[..., None].expand(-1, -1, 3))
    low, high = found.amin(dim=1, keepdim=True), found.amax(dim=1, keepdim=True)
    size = (high - low).amax(dim=-1, keepdim=True)
    return (found - (low + high) / 2.0) / torch.where(size > 0.0, size, 1.0)


def unpack_drawings(bits: Tensor) -> Tensor:
    """Drawings float (n, 1, SIDE, SIDE), ink 1 on 0, of their bits uint8 (n, bytes)."""
    places = torch.arange(7, -1, -1, dtype=torch.uint8, device=bits.device)
    ink = (bits[..., None] >> places) & 1
    return ink.view(len(bits), 1, DRAWING_SIDE_PIXELS, DRAWING_SIDE_PIXELS).float()


def augment_drawings(bits: Tensor, share: float, rng: np.random.Generator, noise: Generator) -> Tensor:
    """Drawings float (n, 1, SIDE, SIDE) of bits uint8 (n, bytes). Of a `share` half are mirrored, and half have thick
    lines, half thin ones."""
    drawings = unpack_drawings(bits)
    mirrored, morphology = rng.random((2, len(bits)))
    (rows,) = np.nonzero(mirrored < 0.5 * share)
    drawings[rows] = drawings[rows].flip(-1)
    (rows,) = np.nonzero(morphology < 0.5 * share)
    drawings[rows] = max_pool2d(drawings[rows], 3, 1, 1)
    (rows,) = np.nonzero((morphology >= 0.5 * share) & (morphology < share))
    kept = (
        torch.rand((len(rows), 1, DRAWING_SIDE_PIXELS, DRAWING_SIDE_PIXELS), generator=noise, device=bits.device)
        < LEAST_INK
    )
    drawings[rows] = drawings[rows] * kept
    return drawings
