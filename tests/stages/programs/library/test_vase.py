"""Vases are on the ground and hollow, with a wall of their thickness and a fitting lid."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
import pytest

from stages.programs.curves import Part
from stages.programs.draws import draw
from stages.programs.library.vase import MIN_WALL_THICKNESS, PROGRAM
from stages.programs.library.vessel import VesselSection, Wall


def random_vases(count: int) -> list[dict[str, Any]]:
    columns = draw(PROGRAM.schema, count, np.random.default_rng(21), off_grid=True).columns
    return [PROGRAM.schema.from_vector(column) for column in columns.T]


def vase(**changed: float) -> list[Part]:
    plain = {"handle_count": 0, "has_neck": False, "has_base": False, "has_lid": False, "body_profile_blend": 1.0}
    return list(PROGRAM.parts(PROGRAM.schema.complete({**plain, **changed})))


def part(parts: list[Part], label: str) -> Part:
    (labelled,) = (candidate for candidate in parts if candidate.label == label)
    return labelled


def test_vases_are_on_the_ground_with_their_parts() -> None:
    for values in random_vases(300):
        parts = PROGRAM.parts(values)
        labels = Counter(piece.label for piece in parts)
        assert min(piece.mesh.bounds[0, 1] for piece in parts) == pytest.approx(0.0, abs=1e-9)
        assert labels == +Counter(
            body=1,
            neck=values["has_neck"],
            base=values["has_base"],
            handle=values["handle_count"],
            lid=values["has_lid"],
            lid_handle=values["has_lid"] and values["has_lid_handle"],
        )


def test_handles_stay_out_of_the_cavity() -> None:
    for values in random_vases(120):
        parts = PROGRAM.parts({**values, "body_profile_blend": 1.0})
        body = part(list(parts), "body").mesh.vertices
        radius, height = np.hypot(body[:, 0], body[:, 2]), body[:, 1]
        # The last rings go down the inner side to the floor.
        inner = slice(int(np.flatnonzero(height == height.max())[-1]), len(body) - 2)
        order = np.argsort(height[inner])
        for handle in (piece for piece in parts if piece.label == "handle"):
            x, y, z = handle.mesh.vertices.T
            within = (y > height[inner].min()) & (y < height[inner].max())
            cavity = np.interp(y, height[inner][order], radius[inner][order])
            assert (np.hypot(x, z)[within] > cavity[within] - 0.004).all(), PROGRAM.schema.to_text(values)


@pytest.mark.parametrize("thickness", [0.01, 0.04, 0.07])
def test_wall_has_its_thickness_outside_the_opening(thickness: float) -> None:
    shape: dict[str, float] = {
        "body_width": 0.3,
        "body_bottom_curve_width": 0.5,
        "body_top_curve_width": 0.3,
        "body_mouth_width": 0.4,
    }
    thin, thick = (
        part(vase(has_body_thickness=flag, body_thickness_val=thickness, **shape), "body").mesh
        for flag in (False, True)
    )
    wider = (thick.bounds - thin.bounds)[:, [0, 2]]
    np.testing.assert_allclose(np.abs(wider), thickness - MIN_WALL_THICKNESS, atol=0.003)


@pytest.mark.parametrize("thickness", [0.005, 0.03, 0.2])
def test_outer_points_are_at_the_distance_of_the_thickness(thickness: float) -> None:
    t = np.linspace(0.0, 1.0, 60)
    inner = np.column_stack([0.2 + 0.1 * np.sin(9.0 * t), t])
    outer = Wall(inner, thickness, 0.02).outer[1:]
    distance = np.linalg.norm(outer[:, None] - inner, axis=2).min(axis=1)
    assert (distance > 0.95 * thickness).all()
    assert (distance < 1.02 * thickness + 0.02).all()


def test_thick_low_neck_has_volume() -> None:
    low = {"has_neck": True, "has_body_thickness": True, "body_thickness_val": 0.07, "neck_end_z": 0.0}
    for values in random_vases(600):
        parts = list(PROGRAM.parts({**values, **low, "handle_count": 0, "has_lid": False}))
        assert part(parts, "neck").mesh.volume > 0.0


def test_thick_wall_is_visible_under_a_lid() -> None:
    plain, thick = vase(has_lid=True), vase(has_lid=True, has_body_thickness=True)
    assert np.ptp(part(thick, "body").mesh.bounds[:, 0]) > np.ptp(part(plain, "body").mesh.bounds[:, 0]) + 0.05


def test_lid_covers_the_opening_on_the_rim() -> None:
    for values in random_vases(100):
        round_vase = {**values, "has_lid": True, "body_profile_blend": 1.0}
        parts = list(PROGRAM.parts(round_vase))
        lid = part(parts, "lid").mesh
        rim = part(parts, "neck" if values["has_neck"] else "body").mesh
        opening = np.hypot(*rim.vertices[rim.vertices[:, 1] > rim.bounds[1, 1] - 1e-6][:, [0, 2]].T).min()
        assert lid.bounds[1, 0] >= opening
        assert lid.bounds[0, 1] < rim.bounds[1, 1] < lid.bounds[1, 1]


def test_cross_section_ranges_from_a_square_to_a_circle() -> None:
    corner = [VesselSection(roundness).reach(45.0) for roundness in (0.0, 0.5, 1.0)]
    assert 1.414 > corner[0] > 1.3 > corner[1] > corner[2] == pytest.approx(1.0)
    for roundness in (0.0, 0.3, 1.0):
        assert VesselSection(roundness).reach(90.0) == pytest.approx(1.0)
