"""Properties of every building block, and exact sizes of some."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from stages.programs.curves import (
    QuadMesh,
    Style,
    arc,
    bezier,
    box,
    circle,
    cylinder,
    extrude,
    hollow,
    line,
    loft,
    loft_rings,
    mesh_defects,
    polyline,
    rectangle,
    revolve,
    rounded_box,
    solidify,
    square_circle,
    sweep,
)
from stages.programs.curves.profile import Profile
from tests.stages.programs.curves.blocks import BLOCKS, DESIGN, STAR, wavy_grid


@pytest.mark.parametrize("name", BLOCKS)
def test_every_block_is_closed_oriented_outwards_and_two_manifold(name: str) -> None:
    mesh = BLOCKS[name]()
    assert mesh_defects(mesh) == []
    assert mesh.vertices.dtype == np.float64
    assert mesh.quads.dtype == np.int32


@pytest.mark.parametrize("name", BLOCKS)
def test_trimesh_agrees(name: str) -> None:
    mesh = BLOCKS[name]()
    peer = trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False)
    assert peer.is_watertight
    assert peer.is_winding_consistent
    assert peer.volume == pytest.approx(mesh.volume)
    assert peer.volume > 0


@pytest.mark.parametrize("name", BLOCKS)
def test_every_block_is_made_the_same_again(name: str) -> None:
    one, two = BLOCKS[name](), BLOCKS[name]()
    assert one.vertices.tobytes() == two.vertices.tobytes()
    assert one.triangles.tobytes() == two.triangles.tobytes()


def test_sizes_are_as_in_elementary_geometry() -> None:
    assert box((1, 2, 3)).volume == pytest.approx(6)
    assert sweep(line((0, 0, 0), (0, 0, 2)), rectangle(0.5, 0.25)).volume == pytest.approx(0.25)
    assert cylinder(1, 2, count=256).volume == pytest.approx(2 * np.pi, rel=1e-3)
    assert cylinder(1, 3, 0, count=256).volume == pytest.approx(np.pi, rel=1e-3)
    assert extrude(STAR, 2.0).volume == pytest.approx(2 * STAR.area)
    assert sweep(arc(1, count=128), circle(0.1, 64)).volume == pytest.approx(2 * np.pi**2 * 0.01, rel=5e-3)
    assert rounded_box((1, 1, 1), 0.49, steps=24).volume == pytest.approx(0.5432, abs=0.01)


def test_quarter_revolution_is_a_quarter() -> None:
    whole, quarter = revolve(DESIGN, count=48), revolve(DESIGN, 90, count=12)
    assert quarter.volume == pytest.approx(whole.volume / 4)
    # Counter-clockwise seen from +y: from +x towards -z.
    assert quarter.bounds[0, 0] == pytest.approx(0, abs=1e-12)
    assert quarter.bounds[1, 2] == pytest.approx(0, abs=1e-12)


def test_outline_ending_off_the_axis_is_closed_flat() -> None:
    drum = revolve(line((1, 0, 0), (1, 2, 0)), count=256)
    assert drum.volume == pytest.approx(2 * np.pi, rel=1e-3)


def test_hollow_vessel_has_its_wall() -> None:
    pot = revolve(hollow(line((1, 0, 0), (1, 2, 0)), 0.1), count=256)
    assert pot.volume == pytest.approx(np.pi * (2 - 0.81 * 1.9), rel=1e-3)
    with pytest.raises(ValueError, match="make it thinner"):
        hollow(line((0.05, 0, 0), (0.05, 1, 0)), 0.1)


def test_vessel_may_have_a_foot_outline() -> None:
    bowl = revolve(hollow(polyline([(0, 0), (0.3, 0), (0.35, 0.5)]), 0.02))
    assert mesh_defects(bowl) == []
    middle = bowl.vertices[np.hypot(bowl.vertices[:, 0], bowl.vertices[:, 2]) < 1e-12]
    assert sorted(middle[:, 1].tolist()) == pytest.approx([0, 0.02])


def test_corners_of_a_swept_frame_are_mitred() -> None:
    rail = polyline([(0, 0), (0, 1), (1, 1), (1, 0)], closed=True)
    frame = sweep(rail, rectangle(0.1, 0.2))
    assert len(frame.vertices) == 16
    assert frame.volume == pytest.approx(4 * 0.1 * 0.2)
    extent = frame.bounds[1] - frame.bounds[0]
    assert sorted(extent.tolist()) == pytest.approx([0.1, 1.2, 1.2]) or sorted(extent.tolist()) == pytest.approx(
        [0.2, 1.1, 1.1]
    )


def test_profile_leans_towards_up() -> None:
    lying = sweep(line((0, 0, 0), (1, 0, 0)), rectangle(0.1, 0.3))
    assert (lying.bounds[1] - lying.bounds[0]).tolist() == pytest.approx([1, 0.3, 0.1])
    leg = sweep(line((0, 0, 0), (0, 1, 0)), rectangle(0.1, 0.3))
    assert (leg.bounds[1] - leg.bounds[0]).tolist() == pytest.approx([0.1, 1, 0.3])
    turned = sweep(line((0, 0, 0), (0, 1, 0)), rectangle(0.1, 0.3), up=(1, 0, 0))
    assert (turned.bounds[1] - turned.bounds[0]).tolist() == pytest.approx([0.3, 1, 0.1])
    with pytest.raises(ValueError, match="is parallel to"):
        sweep(line((0, 0, 0), (0, 1, 0)), rectangle(0.1), up=(0, 2, 0))


def test_style_scales_by_position_and_closes_at_zero() -> None:
    style = Style.knots([(0, 1.0), (0.25, (2.0, 0.5)), (1, 0.0)])
    mesh = sweep(line((0, 0, 0), (0, 4, 0)), rectangle(0.2, 0.2), style)
    ring = mesh.vertices[np.isclose(mesh.vertices[:, 1], 1.0)]
    assert np.ptp(ring, axis=0).tolist() == pytest.approx([0.4, 0, 0.1])
    assert np.isclose(mesh.vertices[:, 1], 4.0).sum() == 1
    assert mesh_defects(mesh) == []


def test_styles_without_a_solid_are_refused() -> None:
    rail = line((0, 0, 0), (0, 1, 0))
    with pytest.raises(ValueError, match="only the first and the last"):
        sweep(rail, circle(0.1), Style.knots([(0, 1.0), (0.5, 0.0), (1, 1.0)]))
    with pytest.raises(ValueError, match="one axis alone"):
        sweep(rail, circle(0.1), Style.taper(1.0, (0.0, 1.0)))
    with pytest.raises(ValueError, match="only the first and the last"):
        sweep(rail, circle(0.1), Style.taper(0.0, 0.0))
    with pytest.raises(ValueError, match="takes no round cap"):
        sweep(rail, circle(0.1), Style.taper(1.0, 0.0), caps="round")
    with pytest.raises(ValueError, match="not negative"):
        Style.taper(1.0, -0.1)
    with pytest.raises(ValueError, match="whole turns"):
        sweep(arc(1), circle(0.1), Style.taper(1, 1, twist=90, count=4))
    with pytest.raises(ValueError, match="last scale is its first"):
        sweep(arc(1), circle(0.1), Style.taper(1, 2))


def test_smooth_style_passes_its_knots_without_overshoot() -> None:
    style = Style.knots([(0, 0.0), (0.3, 1.0), (0.6, 0.9), (1, 0.2)], smooth=True, count=50)
    scale, _ = style.at(np.array([0, 0.3, 0.6, 1.0]))
    assert scale[:, 0] == pytest.approx([0, 1, 0.9, 0.2])
    assert style.scale.min() >= 0
    assert style.scale.max() <= 1


def test_loft_blends_profiles() -> None:
    mesh = loft(line((0, 0, 0), (0, 1, 0)), [(0, rectangle(1)), (0.5, rectangle(3)), (1, rectangle(1))])
    assert mesh.bounds[1, 0] == pytest.approx(1.5)
    with pytest.raises(ValueError, match="one count of points"):
        loft(line((0, 0, 0), (0, 1, 0)), [(0, rectangle(1)), (1, circle(1))])


def test_loft_of_rings_in_space() -> None:
    ring = square_circle(1.0).curve("z").points
    assert mesh_defects(loft_rings([ring, ring + np.array([0, 0, 1])])) == []
    assert mesh_defects(loft_rings([ring, ring - np.array([0, 0, 1])])) == [
        "1 of 1 surfaces are inside out or enclose nothing"
    ]


def test_shell_has_its_thickness_and_offset() -> None:
    flat = wavy_grid() * [1, 1, 0]
    for offset, low, high in ((0, -0.05, 0.05), (1, -0.1, 0), (-1, 0, 0.1)):
        shell = solidify(flat, 0.1, offset)
        assert shell.volume == pytest.approx(0.1)
        assert shell.bounds[:, 2].tolist() == pytest.approx([low, high])
    with pytest.raises(ValueError, match="above 0 everywhere"):
        solidify(flat, 0.0)


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_board_is_on_its_base_over_its_profile(axis: str) -> None:
    profile = Profile.of([(0, 0), (3, 0), (0, 1)])
    board = extrude(profile, 0.5, axis, base=2.0)  # type: ignore[arg-type]
    place = "xyz".index(axis)
    assert board.bounds[:, place].tolist() == pytest.approx([2.0, 2.5])
    drawn = profile.curve(axis, 2.0).points  # type: ignore[arg-type]
    on_base = board.vertices[np.isclose(board.vertices[:, place], 2.0)]
    assert sorted(map(tuple, on_base.round(9).tolist())) == sorted(map(tuple, drawn.round(9).tolist()))


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(*[st.floats(-1, 1)] * 3), min_size=4, max_size=4, unique=True),
    st.floats(0, 1),
    st.floats(0, 2),
    st.floats(-360, 360),
    st.sampled_from(["flat", "round"]),
)
def test_any_sweep_is_closed_or_refused(points, roundness, end, turn, cap) -> None:
    try:
        rail = bezier(points)
        style = Style.taper(1.0, end if end > 1e-3 else 0.0, twist=turn, count=8)
        mesh = sweep(rail, square_circle(roundness, 0.01, 0.02), style, caps=("flat", cap))
    except ValueError:
        # Refused: coincident points, curves that turn back, a dome on a point.
        return
    # A rail may turn tighter than its profile is wide, which folds quads; everything else holds.
    assert [fault for fault in mesh_defects(mesh) if "folded" not in fault] == []


@pytest.mark.parametrize("first", range(4))
def test_quad_with_a_notch_is_cut_there(first: int) -> None:
    corners = np.array([[0, 0, 0], [1, 2, 0], [0, 0.5, 0], [-1, 2, 0]], dtype=float)
    dart = QuadMesh(corners, np.roll([[0, 1, 2, 3]], first, axis=1).astype(np.int32))
    assert sorted(map(sorted, dart.triangles.tolist())) == [[0, 1, 2], [0, 2, 3]]
