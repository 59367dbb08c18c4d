"""Profiles: sizes, orientation, from square to circle, fillings, errors."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stages.programs.curves import Profile, circle, polygon, rectangle, rounded_rectangle, square_circle, superellipse
from tests.stages.programs.curves.blocks import ELL, STAR


def test_roundness_goes_from_square_to_circle() -> None:
    square, middle, round_ = (square_circle(roundness, 2, count=64) for roundness in (0, 0.5, 1))
    assert square.area == pytest.approx(4)
    assert np.hypot(*round_.points.T) == pytest.approx(1)
    assert 3.2 < middle.area < 3.95
    assert square.points[0].tolist() == pytest.approx([1, 1])


@given(st.floats(0, 1), st.floats(0.1, 2), st.floats(0.1, 2), st.sampled_from([8, 16, 24]))
def test_every_roundness_fills_its_box_counter_clockwise(roundness, width, height, count) -> None:
    profile = square_circle(roundness, width, height, count)
    assert profile.size.tolist() == pytest.approx([width, height])
    assert profile.area > 0
    assert len(profile) == count


def test_sizes_of_other_profiles() -> None:
    assert rectangle(2, 3).points.tolist() == [[1, 1.5], [-1, 1.5], [-1, -1.5], [1, -1.5]]
    assert circle(0.5, 8).size.tolist() == pytest.approx([1, 1])
    assert superellipse(2, 2, 1, 32).area == pytest.approx(2)
    assert rounded_rectangle(2, 1, 0.25, 64).area == pytest.approx(2 - (4 - np.pi) * 0.25**2, rel=1e-4)
    assert len(rounded_rectangle(2, 1, 0.0)) == 4
    hexagon = polygon(6, 1.0)
    assert hexagon.area == pytest.approx(1.5 * np.sqrt(3))
    assert np.isclose(hexagon.points[:, 1], hexagon.points[:, 1].min()).sum() == 2


@pytest.mark.parametrize("profile", [ELL, STAR, rectangle(1, 2), circle(1), polygon(5, 1), square_circle(0)])
def test_cap_covers_the_profile_once(profile: Profile) -> None:
    points = np.concatenate([profile.points, [profile.points.mean(axis=0)]])
    a, b, c, d = (points[profile.cap.quads[:, k]] for k in range(4))
    e, f = c - a, d - b
    twice = e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0]
    assert twice.sum() / 2 == pytest.approx(profile.area)
    assert twice.min() > 0


def test_orientation_and_repeated_points_do_not_matter() -> None:
    points = [(0, 0), (0, 1), (1, 0)]
    assert Profile.of(points).area == pytest.approx(0.5)
    assert Profile.of(points[::-1]).area == pytest.approx(0.5)
    assert len(Profile.of([*points, points[0], points[0]])) == 3


def test_inset_moves_every_side() -> None:
    assert rectangle(2, 3).inset(0.25).size.tolist() == pytest.approx([1.5, 2.5])
    assert ELL.inset(0.05).area < ELL.area < ELL.inset(-0.05).area
    with pytest.raises(ValueError, match="use less"):
        rectangle(2, 3).inset(1.1)


def test_profiles_are_moved_and_scaled() -> None:
    assert rectangle(2, 4).rotated(90).size.tolist() == pytest.approx([4, 2])
    assert rectangle(2).translated(3, 1).points.mean(axis=0).tolist() == [3, 1]
    assert rectangle(2).scaled(2, 3).size.tolist() == [4, 6]


@pytest.mark.parametrize(
    ("make", "mend"),
    [
        (lambda: Profile.of([(0, 0), (2, 2), (2, 0), (0, 1)]), "crosses itself"),
        (lambda: Profile.of([(0, 0), (1, 1), (2, 2)]), "no area"),
        (lambda: Profile.of([(0, 0), (1, 1)]), "move its points apart"),
        (lambda: square_circle(1.5), "from 0"),
        (lambda: circle(0), "above 0"),
        (lambda: circle(1, 10), "4, 8, 12"),
        (lambda: rounded_rectangle(2, 1, 0.6), "half the shorter side, 0.5"),
        (lambda: polygon(2, 1), "3 sides"),
        (lambda: rectangle(1).scaled(0), "above 0"),
    ],
)
def test_errors_name_a_remedy(make, mend) -> None:
    with pytest.raises(ValueError, match=mend):
        make()
