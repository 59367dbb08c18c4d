from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipped_kits.outlines import arch, chamfered, grown, mirrored, rectangle, regular, triangulate
from stages.shape.arrays import FloatArray


def area(outline: FloatArray) -> float:
    following = np.roll(outline, -1, axis=0)
    return float((outline[:, 0] * following[:, 1] - outline[:, 1] * following[:, 0]).sum() / 2)


def triangle_areas(points: FloatArray, triangles: list[tuple[int, int, int]]) -> FloatArray:
    return np.array([area(points[list(triangle)]) for triangle in triangles])


def test_outlines_are_counter_clockwise_and_of_the_size_they_say() -> None:
    assert area(rectangle(2.0, 3.0, 5.0, 5.0)) == pytest.approx(6.0)
    assert area(chamfered(2.0, 2.0, 0.5)) == pytest.approx(4.0 - 4 * 0.125)
    assert area(regular(6, 1.0)) == pytest.approx(6 * np.tan(np.pi / 6))
    assert area(arch(2.0, 3.0, 1.0, 64)) == pytest.approx(4.0 + np.pi / 2, rel=1e-3)


def test_a_grown_outline_has_every_side_moved_by_the_distance() -> None:
    assert grown(rectangle(2.0, 2.0), 0.5) == pytest.approx(rectangle(3.0, 3.0))
    assert grown(regular(8, 1.0), -0.25) == pytest.approx(regular(8, 0.75))


def test_a_mirrored_outline_is_its_own_mirror_image() -> None:
    outline = mirrored((2.0, 0.0), (2.0, 1.0), (0.5, 3.0))
    assert area(outline) > 0
    assert {(-x, y) for x, y in outline.tolist()} == {(x, y) for x, y in outline.tolist()}


def test_a_regular_polygon_has_the_middle_of_a_side_on_the_x_axis() -> None:
    for sides in (5, 6, 8):
        assert regular(sides, 1.5)[:2].mean(axis=0) == pytest.approx([1.5, 0.0])


def test_a_square_with_a_hole_is_covered_without_overlap() -> None:
    points = np.concatenate([rectangle(4.0, 4.0), rectangle(2.0, 2.0)])
    areas = triangle_areas(points, triangulate(points, [(0, 1, 2, 3), (7, 6, 5, 4)]))
    assert len(areas) == 8
    assert (areas > 0).all()
    assert areas.sum() == pytest.approx(12.0)


def test_holes_in_a_row_are_all_left_open() -> None:
    holes = [rectangle(0.5, 0.5, x, 0.0) for x in (-3.0, -1.0, 1.0, 3.0)]
    points = np.concatenate([rectangle(8.0, 1.0), *holes])
    loops = [(0, 1, 2, 3), *[(4 * k + 7, 4 * k + 6, 4 * k + 5, 4 * k + 4) for k in range(4)]]
    areas = triangle_areas(points, triangulate(points, loops))
    assert (areas > 0).all()
    assert areas.sum() == pytest.approx(8.0 - 4 * 0.25)


def test_neighbouring_holes_in_a_corner_are_all_left_open() -> None:
    triangle = np.array([(-1.5, 0.0), (1.5, 0.0), (0.0, 0.8)])
    holes = [regular(8, 0.2) + np.array([0.0, 0.3]), regular(6, 0.11) + np.array([-0.58, 0.14])]
    holes.append(holes[1] + np.array([1.16, 0.0]))
    points = np.concatenate([triangle, *holes])
    loops = [(0, 1, 2), tuple(range(10, 2, -1)), tuple(range(16, 10, -1)), tuple(range(22, 16, -1))]
    areas = triangle_areas(points, triangulate(points, loops))
    assert (areas > 0).all()
    assert areas.sum() == pytest.approx(area(triangle) - sum(area(hole) for hole in holes))


def test_outline_that_crosses_itself_or_runs_clockwise_is_rejected() -> None:
    bow_tie = np.array([(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)])
    for points in (bow_tie, rectangle(1.0, 1.0)[::-1]):
        with pytest.raises(ValueError, match="crosses itself or runs clockwise"):
            triangulate(points, [(0, 1, 2, 3)])


@given(st.lists(st.floats(0.2, 3.0), min_size=3, max_size=24))
def test_any_star_shaped_outline_is_covered_without_overlap(radii: list[float]) -> None:
    angles = 2 * np.pi * np.arange(len(radii)) / len(radii)
    points = np.stack([np.cos(angles), np.sin(angles)], axis=1) * np.array(radii)[:, None]
    areas = triangle_areas(points, triangulate(points, [tuple(range(len(radii)))]))
    assert len(areas) == len(radii) - 2
    assert (areas >= -1e-9).all()
    assert areas.sum() == pytest.approx(area(points))
