"""How bodies come to rest: known cases, then laws that hold for all convex bodies."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stages.shape.arrays import FloatArray
from stages.shape.physics.judge import Judge, fall_fields
from stages.shape.physics.settings import PhysicsConfig
from stages.shape.physics.settling import Body, Fall, come_to_rest, hull_vertices, tilt_to_fall
from stages.shape.shape import Shape
from tests.stages.shape.geometry.bodies import box
from tests.stages.shape.physics.structures import solid


def block(x: float, y: float, z: float) -> Body:
    corners = np.array([[i, j, k] for i in (-x, x) for j in (-y, y) for k in (-z, z)]) / 2
    return Body(corners, np.zeros(3))


def turned(body: Body, degrees: float) -> Body:
    """Leaning along x."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    return Body(body.points @ turn.T, turn @ body.centre)


@pytest.mark.parametrize(("degrees", "height"), [(0, 1.0), (20, 1.0), (26, 1.0), (27, 0.5), (80, 0.5), (-27, 0.5)])
def test_a_leaning_block_comes_to_rest_on_the_face_below_its_centre(degrees: float, height: float) -> None:
    """Half as wide as high: it tips at 26.6 degrees."""
    rest = come_to_rest(turned(block(1, 1, 2), degrees), 3.0)
    assert rest.height == pytest.approx(height)


@pytest.mark.parametrize(("sizes", "tilt"), [((1, 3, 2), math.atan(0.5)), ((4, 3, 1), math.atan(3)), ((1, 1, 1), None)])
def test_a_block_falls_beyond_the_tilt_of_its_narrower_side(sizes: tuple[float, ...], tilt: float | None) -> None:
    """A cube does not fall: it is as high on any of its faces."""
    found = tilt_to_fall(block(*sizes), float(np.linalg.norm(sizes)))
    assert found == (math.inf if tilt is None else pytest.approx(math.degrees(tilt)))


def table(legs: list[float]) -> Shape:
    """A top of 2 by 2 at height 1, with legs of these lengths at its corners."""
    bodies = [box(0.1, 0.1, length, at=(x, y, 1 - length / 2)) for length, (x, y) in zip(legs, PLACES, strict=True)]
    return solid(box(2.0, 2.0, 0.1, at=(0.0, 0.0, 1.05)), *bodies)


PLACES = ((-0.95, -0.95), (0.95, -0.95), (-0.95, 0.95), (0.95, 0.95))


def tilt(shape: Shape) -> float:
    return Judge(shape.meshes, shape.up, PhysicsConfig()).fall(shape.assembly).tilt_degrees


def test_a_table_rocks_on_a_leg_a_little_short_and_falls_on_one_that_is_missing() -> None:
    sound = tilt(table([1.0, 1.0, 1.0, 1.0]))
    rocking = tilt(table([1.0, 1.0, 1.0, 0.98]))
    assert sound == pytest.approx(45.0)
    assert 40 < rocking < sound
    assert tilt(table([1.0, 1.0, 0.7, 0.7])) == 0.0


def test_what_does_not_hang_together_falls_by_itself_and_what_floats_is_not_rooted() -> None:
    sound, lean = box(1.0, 1.0, 1.0, at=(0.0, 0.0, 0.0)), box(0.05, 1.0, 1.0, at=(3.0, 0.0, 0.0))
    assert tilt(solid(sound, lean)) == pytest.approx(math.degrees(math.atan(0.05)))
    assert tilt(solid(sound, box(1.0, 1.0, 1.0, at=(0.0, 0.0, 3.0)))) == 0.0


def test_the_piece_that_falls_and_the_part_that_floats_are_named() -> None:
    sound, lean = box(1.0, 1.0, 1.0, at=(0.0, 0.0, 0.0)), box(0.05, 1.0, 1.0, at=(3.0, 0.0, 0.0))
    shape = solid(sound, lean)
    fall = Judge(shape.meshes, shape.up, PhysicsConfig()).fall(shape.assembly)
    assert (fall.part, fall.falls) == (1, True)
    floating = solid(sound, box(1.0, 1.0, 1.0, at=(0.0, 0.0, 3.0)))
    assert Judge(floating.meshes, floating.up, PhysicsConfig()).fall(floating.assembly) == Fall(0.0, 1)
    cube = solid(sound)
    fall = Judge(cube.meshes, cube.up, PhysicsConfig()).fall(cube.assembly)
    assert fall_fields(fall) == {"falls": False, "fall_degrees": 90.0, "fallen": -1}


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10_000))
def test_points_within_the_hull_do_not_matter(seed: int) -> None:
    points = np.random.default_rng(seed).normal(size=(60, 3))
    corners = hull_vertices(points)
    assert len(corners) < len(points)
    whole, hull = (tilt_to_fall(Body(cloud, points.mean(axis=0)), 5.0) for cloud in (points, corners))
    assert hull == pytest.approx(whole, abs=1e-9)


CLOUDS = st.integers(0, 10_000).map(lambda seed: np.random.default_rng(seed).normal(size=(12, 3)))


@settings(deadline=None, max_examples=60)
@given(CLOUDS)
def test_a_body_rests_on_a_face_of_its_hull_below_its_centre_and_never_rises(points: FloatArray) -> None:
    from scipy.spatial import ConvexHull

    body = Body(points, points.mean(axis=0))
    rest = come_to_rest(body, 5.0)
    assert rest.height <= body.lowered().height + 1e-9
    hull = ConvexHull(rest.points)
    below = hull.equations[hull.equations[:, 2].argmin()]
    assert below[2] == pytest.approx(-1.0, abs=1e-5)
    assert rest.points[:, 2].min() == pytest.approx(0.0, abs=1e-12)
    # Rigid: all distances are as before.
    before, after = (np.linalg.norm(cloud[:, None] - cloud, axis=2) for cloud in (points, rest.points))
    np.testing.assert_allclose(before, after, atol=1e-9)


@settings(deadline=None, max_examples=30)
@given(CLOUDS, st.floats(0, 6.28), st.floats(0.1, 10))
def test_neither_bearing_nor_size_matters(points: FloatArray, azimuth: float, scale: float) -> None:
    c, s = math.cos(azimuth), math.sin(azimuth)
    turn = scale * np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    once = tilt_to_fall(Body(points, points.mean(axis=0)), 5.0)
    again = tilt_to_fall(Body(points @ turn.T, turn @ points.mean(axis=0)), 5.0 * scale)
    assert again == pytest.approx(once, abs=1e-3)
