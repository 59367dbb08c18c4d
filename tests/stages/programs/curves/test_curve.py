"""Curves: sampling by arc length, frames without flips, errors."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stages.programs.curves import Curve, arc, bezier, chain, helix, line, polyline, spiral, translation

UNEVEN = [(0, 0, 0), (1, 0, 0), (1, 3, 0)]


def test_positions_are_relative_arc_length() -> None:
    curve = polyline(UNEVEN)
    assert curve.length == pytest.approx(4)
    assert curve.at(0.25).tolist() == pytest.approx([1, 0, 0])
    assert curve.at([0, 0.5, 1]).tolist() == [[0, 0, 0], pytest.approx([1, 1, 0]), [1, 3, 0]]


def test_positions_of_a_closed_curve_are_modulo_one() -> None:
    square = polyline([(0, 0), (1, 0), (1, 1), (0, 1)], closed=True)
    assert square.length == pytest.approx(4)
    assert square.at([0.875, -0.125, 1.0]).tolist() == [
        pytest.approx([0, 0.5, 0]),
        pytest.approx([0, 0.5, 0]),
        pytest.approx([0, 0, 0]),
    ]


def test_tangents_halve_a_corner_and_follow_straight_pieces() -> None:
    curve = polyline(UNEVEN)
    half = np.sqrt(0.5)
    assert curve.tangents([0.1, 0.25, 0.6]).tolist() == [[1, 0, 0], pytest.approx([half, half, 0]), [0, 1, 0]]


def test_position_outside_is_refused() -> None:
    with pytest.raises(ValueError, match=r"position 1\.2 is outside"):
        polyline(UNEVEN).at(1.2)


def test_bezier_ends_are_along_its_handles() -> None:
    curve = bezier([(0, 0, 0), (0, 1, 0), (2, 1, 0), (2, 0, 0)], 40)
    assert curve.at([0, 0.5, 1]).tolist() == [[0, 0, 0], pytest.approx([1, 0.75, 0]), [2, 0, 0]]
    assert curve.tangents(0.0)[1] > 0.98
    with pytest.raises(ValueError, match="not 5"):
        bezier(np.eye(5)[:, :3])


def test_closed_bezier_is_joined() -> None:
    k = 0.5523
    loop = bezier(
        [(1, 0), (1, k), (k, 1), (0, 1), (-k, 1), (-1, k), (-1, 0), (-1, -k), (-k, -1), (0, -1), (k, -1), (1, -k)],
        16,
        closed=True,
    )
    assert loop.length == pytest.approx(2 * np.pi, rel=1e-3)
    assert np.linalg.norm(loop.at(np.linspace(0, 1, 33)), axis=1) == pytest.approx(1, abs=3e-3)


@pytest.mark.parametrize(("axis", "quarter"), [("x", [0, 0, 2]), ("y", [0, 0, -2]), ("z", [0, 2, 0])])
def test_arcs_are_counter_clockwise(axis, quarter) -> None:
    assert arc(2, 0, 90, axis).points[-1].tolist() == pytest.approx(quarter, abs=1e-12)
    assert arc(2, axis=axis).closed
    assert helix(1, 3, 2.5, axis).points[-1]["xyz".index(axis)] == pytest.approx(3)


def test_spiral_goes_from_one_radius_to_the_other() -> None:
    points = spiral(0.5, 2, 1.5).points
    assert np.linalg.norm(points[[0, -1]], axis=1) == pytest.approx([0.5, 2])


def test_repeated_points_count_once() -> None:
    assert len(polyline([(0, 0), (0, 0), (1, 0), (1, 0), (2, 1), (2, 1)]).points) == 3
    assert len(polyline([(0, 0), (1, 0), (1, 1), (0, 0)], closed=True).points) == 3


@pytest.mark.parametrize(
    ("points", "closed", "mend"),
    [
        ([(0, 0, 0), (0, 0, 0)], False, "move its points apart"),
        ([(1, 2, 3)], False, "move its points apart"),
        ([(0, 0), (1, 0)], True, "move its points apart"),
        ([(0, 0), (1, 0), (0.5, 0)], False, "point 1: move that point aside"),
        ([(0, 0, 0), (np.nan, 0, 0)], False, "finite"),
        ([[]], False, "shape"),
    ],
)
def test_degenerate_curves_are_refused(points, closed, mend) -> None:
    with pytest.raises(ValueError, match=mend):
        polyline(points, closed)


def test_position_where_a_coordinate_has_a_value() -> None:
    leg = polyline([(0, 0, 0), (0.1, 1, 0), (0, 2, 0)])
    assert leg.at(leg.position_where("y", 0.5)).tolist() == pytest.approx([0.05, 0.5, 0])
    assert leg.position_where("y", 2.0) == pytest.approx(1)
    with pytest.raises(ValueError, match="y is never 3: it goes from 0 to 2"):
        leg.position_where("y", 3)


def test_pieces_and_reversal_keep_the_line() -> None:
    curve = polyline(UNEVEN)
    piece = curve.part(0.125, 0.5)
    assert piece.points.tolist() == [pytest.approx([0.5, 0, 0]), [1, 0, 0], pytest.approx([1, 1, 0])]
    assert curve.reversed().at(0.25).tolist() == pytest.approx([1, 2, 0])
    assert chain(line((0, 0, 0), (1, 0, 0)), line((1, 0, 0), (1, 3, 0))).points.tolist() == curve.points.tolist()
    assert curve.transformed(translation(0, 0, 5)).at(1.0).tolist() == [1, 3, 5]
    loop = polyline([(0, 0), (1, 0), (1, 1), (0, 1)], closed=True)
    assert loop.part(0.5, 1.0).points[:, :2].tolist() == [[1, 1], [0, 1], [0, 0]]


def frames_are_right(frames: np.ndarray) -> None:
    turns = frames[:, :3, :3]
    assert turns @ turns.transpose(0, 2, 1) == pytest.approx(np.broadcast_to(np.eye(3), turns.shape), abs=1e-9)
    assert np.linalg.det(turns) == pytest.approx(1)


@settings(max_examples=50, deadline=None)
@given(st.lists(st.tuples(*[st.floats(-1, 1)] * 3), min_size=4, max_size=4, unique=True))
def test_frames_are_orthonormal_and_do_not_roll(controls) -> None:
    try:
        curve = bezier(controls, 200)
    except ValueError:
        return
    frames = curve.frames(curve.positions)
    frames_are_right(frames)
    turn = np.einsum("nij,nij->n", frames[1:, :3, :3], frames[:-1, :3, :3])
    tangent_turn = np.einsum("ni,ni->n", frames[1:, :3, 2], frames[:-1, :3, 2])
    # A frame that does not roll turns by the angle of its tangent; the trace gives the angle.
    angle = np.arccos(np.clip((turn - 1) / 2, -1, 1))
    assert angle == pytest.approx(np.arccos(np.clip(tangent_turn, -1, 1)), abs=2e-2)


def test_frames_of_a_closed_curve_are_continuous() -> None:
    t = np.linspace(0, 2 * np.pi, 120, endpoint=False)
    knot = polyline(np.stack([np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t), -np.sin(3 * t)], 1), True)
    frames = knot.frames(knot.positions)
    frames_are_right(frames)
    steps = np.einsum("ni,ni->n", frames[:, :3, 0], np.roll(frames[:, :3, 0], -1, axis=0))
    assert steps.min() > 0.95


def test_frames_do_not_flip_at_an_inflection() -> None:
    wave = polyline([(x, np.sin(3 * x), 0) for x in np.linspace(0, 6, 200)])
    frames = wave.frames(np.linspace(0, 1, 50), up=(0, 0, 1))
    assert frames[:, :3, 1] == pytest.approx(np.broadcast_to([0, 0, 1], (50, 3)))


def test_frames_between_points_are_those_of_a_sweep() -> None:
    curve = helix(1, 2, 1.5)
    assert curve.frames(curve.positions[5]) == pytest.approx(curve.frames(curve.positions)[5])
    assert curve.frames(0.3)[:3, 3] == pytest.approx(curve.at(0.3))


def test_curve_properties_are_invariant_under_motion() -> None:
    moved = Curve.through(np.array(UNEVEN) + 5.0)
    assert moved.at(0.7) == pytest.approx(polyline(UNEVEN).at(0.7) + 5.0)
