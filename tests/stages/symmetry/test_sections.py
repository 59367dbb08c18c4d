"""Sections of a surface by planes, and the share that two sections have in common."""

from __future__ import annotations

import numpy as np
import pytest

from stages.symmetry.sections.cross_sections import MAX_NORMAL_DISTANCE, PlaneSection, plane_section, shared_share
from tests.stages.symmetry.planted import box

ALONG = np.array([1.0, 0, 0])


def _cut(corners: np.ndarray, offset: float) -> PlaneSection:
    """Return the section across the first axis."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    heights = corners[..., 0] - offset
    crossed = (heights.min(axis=1) <= 0) & (heights.max(axis=1) > 0)
    return plane_section(corners[crossed], normals[crossed], heights[crossed], 0.01)


def test_a_section_of_a_box_is_as_long_as_the_way_around_it() -> None:
    section = _cut(box((0, 0, 0), (4, 2, 3)), 1.7)
    assert section.length == pytest.approx(10.0)
    assert np.allclose(section.points[:, 0], 1.7)


def test_shared_share_is_the_smaller_share_of_both_sections() -> None:
    corners = np.concatenate([box((0, 0, 0), (4, 2, 3)), box((2, 5, 0), (4, 6, 1.5))])
    alone, both = _cut(corners, 1.0), _cut(corners, 3.0)
    assert shared_share(alone, alone, np.zeros(3), 0.01, 0.0) == 1.0
    assert shared_share(alone, both, 2 * ALONG, 0.01, 0.0) == pytest.approx(10 / 15, abs=0.01)
    assert shared_share(alone, both, 2 * ALONG, 0.01, 0.7) == 0.0
    assert shared_share(alone, both, np.zeros(3), 0.01, 0.0) == 0.0


def test_two_sides_of_a_plate_share_nothing() -> None:
    corners = box((0, 0, 0), (4, 1, 1))
    assert shared_share(_cut(corners, 1.0), _cut(corners[:, ::-1], 1.0), np.zeros(3), 0.01, 0.0) == 0.0


def _line(count: int, seed: int) -> PlaneSection:
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    return PlaneSection(rng.uniform(-1, 1, (count, 3)), normals, rng.uniform(0.5, 1.5, count))


def _share(one: PlaneSection, other: PlaneSection, shift: np.ndarray, tolerance: float) -> float:
    """Return the shared share by comparing every two points."""
    here = np.column_stack([one.points + shift, tolerance / MAX_NORMAL_DISTANCE * one.normals])
    onto = np.column_stack([other.points, tolerance / MAX_NORMAL_DISTANCE * other.normals])
    near = np.linalg.norm(here[:, None] - onto[None], axis=2) < tolerance
    covered = [
        (near.any(axis=1) * one.lengths).sum() / one.lengths.sum(),
        (near.any(axis=0) * other.lengths).sum() / other.lengths.sum(),
    ]
    return float(min(covered))


@pytest.mark.parametrize("tolerance", [0.05, 0.3, 0.8])
def test_shared_share_equals_that_of_all_pairs_of_points(tolerance: float) -> None:
    shift = np.array([0.1, -0.2, 5.0])
    for seed in range(6):
        one, other = _line(60, seed), _line(80, seed + 100)
        mixed = PlaneSection(
            np.concatenate([one.points + shift, other.points]),
            np.concatenate([one.normals, other.normals]),
            np.concatenate([one.lengths, other.lengths]),
        )
        for first, second, moved in ((one, other, np.zeros(3)), (one, mixed, shift)):
            expected = _share(first, second, moved, tolerance)
            assert shared_share(first, second, moved, tolerance, 0.0) == pytest.approx(expected)
            assert shared_share(first, second, moved, tolerance, expected - 1e-6) == pytest.approx(expected)
            assert shared_share(first, second, moved, tolerance, expected + 1e-6) == 0.0


def test_empty_section_shares_nothing() -> None:
    nothing = PlaneSection(np.empty((0, 3)), np.empty((0, 3)), np.empty(0))
    assert shared_share(_line(40, 7), nothing, np.zeros(3), 1e-3, 0.9) == 0.0
