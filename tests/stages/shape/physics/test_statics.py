"""Statics against closed forms: each limit is found within 1 %."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from tests.stages.shape.geometry.bodies import Body, box
from tests.stages.shape.physics.structures import DRY, arch, judged, solid, studded, tower

PLAIN_AND_STUDDED = pytest.mark.parametrize("made", [lambda body: body, studded], ids=["box", "mesh"])
Made = Callable[[Body], Body]

HEYMAN_THICKNESS_RATIO = 0.1075
"""Least thickness over mean radius of a semicircular arch under its own weight (Milankovitch 1907, Heyman 1969)."""


@PLAIN_AND_STUDDED
@pytest.mark.parametrize("count", [2, 5, 9])
def test_tower_stands_exactly_up_to_the_harmonic_overhang(count: int, made: Made) -> None:
    assert judged(solid(*map(made, tower(count, 0.99)))).stable
    fallen = judged(solid(*map(made, tower(count, 1.01))))
    assert not fallen.stable
    assert fallen.margin == -1
    assert fallen.weakest > 0, "the foot stays"


def test_arch_stands_down_to_the_thickness_of_heyman() -> None:
    assert judged(solid(*arch(48, 1.01 * HEYMAN_THICKNESS_RATIO))).stable
    fallen = judged(solid(*arch(48, 0.99 * HEYMAN_THICKNESS_RATIO)))
    assert not fallen.stable
    assert fallen.rooted, "it falls though it hangs together"


@pytest.mark.parametrize("friction", [0.2, 0.5, 0.9])
def test_block_slides_on_a_slope_of_the_arctangent_of_friction(friction: float) -> None:
    for share, holds in ((0.99, True), (1.01, False)):
        slope = np.arctan(friction) * share
        c, s = np.cos(slope), np.sin(slope)
        ramp = np.array([(x, y, z) for y in (-2, 2) for x, z in ((-4 * c, -4 * s), (4 * c, 4 * s), (4 * c, -4 * s))])
        faces = [(0, 1, 2), (3, 5, 4), (0, 3, 4), (0, 4, 1), (1, 4, 5), (1, 5, 2), (2, 5, 3), (2, 3, 0)]
        wedge = ramp, np.array(faces, dtype=np.int32)[:, ::-1].copy()
        vertices, faces_of_block = box(1, 1, 0.4, at=(0, 0, 0.2))
        turn = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
        assert judged(solid(wedge, (vertices @ turn.T, faces_of_block)), friction=friction).stable is holds


@pytest.mark.parametrize("friction", [0.25, 0.4])
def test_leaning_board_stands_down_to_its_slipping_angle(friction: float) -> None:
    limit = (1 - friction**2) / (2 * friction)  # tangent of the angle to the ground, rough wall and rough ground
    for share, holds in ((1.01, True), (0.99, False)):
        angle = np.arctan(limit * share)
        c, s = np.cos(angle), np.sin(angle)
        vertices, faces = box(4, 0.5, 1e-4)
        turn = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
        board = vertices @ turn.T
        board -= [board[:, 0].max(), 0, board[:, 2].min()]
        wall = box(5, 5, 6, at=(2.5, 0, 3))
        assert judged(solid((board, faces), wall), friction=friction).stable is holds


@PLAIN_AND_STUDDED
@pytest.mark.parametrize(("width", "height", "friction"), [(1.0, 0.5, 0.3), (1.0, 4.0, 0.9), (0.3, 1.0, 0.25)])
def test_block_bears_a_push_until_it_slides_or_tips(width: float, height: float, friction: float, made: Made) -> None:
    found = judged(solid(made(box(width, width, height, at=(0, 0, height / 2)))), friction=friction)
    # Twisting: friction at the four corners turns the block about its middle.
    twist = friction * width / np.sqrt(2) / (0.25 * np.sqrt(2 * width**2 + height**2))
    assert found.margin == pytest.approx(min(friction, width / height, twist), rel=0.01)
    assert found.tipping_degrees == pytest.approx(np.degrees(np.arctan(width / height)))


@pytest.mark.parametrize("made", [lambda body: body, studded], ids=["box", "mesh"])
def test_glued_beam_breaks_off_where_its_weight_turns_more_than_glue_bears(made: Made) -> None:
    length, height = 2.0, 0.5
    column, beam = box(2, 1, 4, at=(-1, 0, 2)), box(length, 1, height, at=(length / 2, 0, 3))
    weight = length * height / (length * height + 8)  # of the beam, in weights of both
    # The glue pulls at the two upper corners with half of what it bears, as much presses at the two lower ones.
    least = weight * length / height
    assert judged(solid(made(column), made(beam)), friction=5, tension=1.01 * least).stable
    broken = judged(solid(made(column), made(beam)), friction=5, tension=0.99 * least)
    assert not broken.stable
    assert broken.weakest == 1


def test_rigid_joints_bear_what_dry_joints_do_not() -> None:
    shape = solid(*tower(4, 1.3))
    assert not judged(shape).stable
    assert judged(shape, joints="rigid").stable, "its centre of mass is still above its foot"


def test_penetrating_parts_are_one_body() -> None:
    shelf = box(2, 1, 0.2, at=(0.9, 0, 2))
    beside, into = box(2, 1, 4, at=(-1.1, 0, 2)), box(2, 1, 4, at=(-1, 0, 2))
    assert not judged(solid(beside, shelf)).stable
    assert judged(solid(into, shelf)).stable
    assert judged(solid(studded(into), studded(shelf))).stable


def test_two_legs_in_a_line_stand_and_bear_no_push() -> None:
    flat = solid(box(1, 1e-9, 1, at=(0, 0, 0.5)))
    found = judged(flat, DRY)
    assert found.margin == pytest.approx(0, abs=1e-6)


def test_part_in_the_air_is_the_one_that_gives_way() -> None:
    found = judged(solid(box(), box(0.2, 0.2, 0.2, at=(0, 0, 3))))
    assert (found.rooted, found.stable, found.floating, found.weakest, found.components) == (False, False, 1, 1, 2)
