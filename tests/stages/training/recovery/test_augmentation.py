"""Augmented clouds and drawings."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from torch import Generator

from stages.training.recovery.augmentation import augment_clouds, augment_drawings, quantized_cloud, unpack_drawings
from stages.training.recovery.drawings import DRAWING_SIDE_PIXELS


def clouds(n: int) -> torch.Tensor:
    """Equal cubes of 400 points, quantized."""
    points = np.random.default_rng(1).random((400, 3)) * 7.0
    return torch.from_numpy(np.array([quantized_cloud(points)] * n))


def augmented(n: int, points: int, share: float) -> torch.Tensor:
    return augment_clouds(clouds(n), points, share, Generator().manual_seed(2))


def test_uncorrupted_clouds_are_points_of_the_shape_without_repeats() -> None:
    found = augmented(3, 400, 0.0)
    assert torch.equal(found.sort(dim=1).values[0], found.sort(dim=1).values[2])
    assert not torch.equal(found[0], found[2])
    torch.testing.assert_close(found.abs().amax(dim=(1, 2)), torch.full((3,), 0.5))


def test_corrupted_clouds_have_noise_or_fewer_points() -> None:
    found = augmented(64, 400, 1.0)
    distinct = torch.tensor([len(cloud.unique(dim=0)) for cloud in found])
    assert distinct.min() > 100
    # a seventh has noise alone
    assert 3 <= (distinct == 400).sum() <= 20
    assert found.abs().amax() < 0.5001


def test_remaining_points_are_repeated_evenly() -> None:
    counts = [cloud.unique(dim=0, return_counts=True)[1] for cloud in augmented(64, 400, 1.0)]
    assert all(count.max() - count.min() <= 1 for count in counts)


def test_a_share_is_corrupted() -> None:
    found = augmented(200, 400, 0.5)
    lost = torch.tensor([len(cloud.unique(dim=0)) < 400 for cloud in found])
    assert 0.3 < lost.float().mean() < 0.55


def test_clouds_do_not_depend_on_the_precision_of_the_network() -> None:
    with torch.autocast("cpu", torch.bfloat16):
        found = augmented(8, 200, 1.0)
    assert torch.equal(found, augmented(8, 200, 1.0))


@pytest.fixture
def drawing() -> np.ndarray[tuple[int, int], np.dtype[np.bool_]]:
    ink = np.zeros((DRAWING_SIDE_PIXELS, DRAWING_SIDE_PIXELS), dtype=np.bool_)
    ink[20:200, 30] = ink[40, 30:120] = True
    return ink


def test_drawings_are_unpacked_from_their_bits(drawing: np.ndarray[tuple[int, int], np.dtype[np.bool_]]) -> None:
    found = unpack_drawings(torch.from_numpy(np.packbits(drawing)[None]))
    assert np.array_equal(found[0, 0].numpy() > 0, drawing)


def test_drawings_are_mirrored_thick_and_thin(drawing: np.ndarray[tuple[int, int], np.dtype[np.bool_]]) -> None:
    bits = torch.from_numpy(np.packbits(drawing)[None]).expand(60, -1)
    rng, noise = np.random.default_rng(4), Generator().manual_seed(4)
    found = augment_drawings(bits, 1.0, rng, noise)
    ink = found.sum(dim=(1, 2, 3)) / drawing.sum()
    assert 0.3 < (ink > 2.5).float().mean() < 0.7
    assert ((ink > 2.5) | ((ink > 0.8) & (ink < 1.0))).all()
    mirrored = found[..., DRAWING_SIDE_PIXELS // 2 + 20 :].sum(dim=(1, 2, 3)) > 0
    assert 0.3 < mirrored.float().mean() < 0.7
    assert torch.equal(augment_drawings(bits, 0.0, rng, noise), unpack_drawings(bits))
