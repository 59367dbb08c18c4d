"""Vases stand on the ground, have a wall of the asked thickness, stay open inside, and shut with their lid."""

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


def vase(**chosen: float) -> list[Part]:
    plain = {"handle_count": 0, "has_neck": False, "has_base": False, "has_lid": False, "body_profile_blend": 1.0}
    return list(PROGRAM.parts(PROGRAM.schema.complete({**plain, **chosen})))


def part(parts: list[Part], label: str) -> Part:
    (found,) = (each for each in parts if each.label == label)
    return found


def test_random_vases_stand_on_the_ground_with_the_parts_that_were_asked_for() -> None:
    for values in random_vases(300):
        parts = PROGRAM.parts(values)
        labels = Counter(each.label for each in parts)
        assert min(each.mesh.bounds[0, 1] for each in parts) == pytest.approx(0.0, abs=1e-9)
        assert labels == +Counter(
            body=1,
            neck=values["has_neck"],
            base=values["has_base"],
            handle=values["handle_count"],
            lid=values["has_lid"],
            lid_handle=values["has_lid"] and values["has_lid_handle"],
        )


def test_no_handle_reaches_into_a_round_vase() -> None:
    for values in random_vases(120):
        parts = PROGRAM.parts({**values, "body_profile_blend": 1.0})
        body = part(list(parts), "body").mesh.vertices
        radius, height = np.hypot(body[:, 0], body[:, 2]), body[:, 1]
        # The last rings go down the inner side to the floor.
        inner = slice(int(np.flatnonzero(height == height.max())[-1]), len(body) - 2)
        order = np.argsort(height[inner])
        for handle in (each for each in parts if each.label == "handle"):
            x, y, z = handle.mesh.vertices.T
            within = (y > height[inner].min()) & (y < height[inner].max())
            cavity = np.interp(y, height[inner][order], radius[inner][order])
            assert (np.hypot(x, z)[within] > cavity[within] - 0.004).all(), PROGRAM.schema.to_text(values)


@pytest.mark.parametrize("thickness", [0.01, 0.04, 0.07])
def test_the_wall_is_as_thick_as_asked_and_lies_outside_the_opening(thickness: float) -> None:
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
def test_outer_points_of_a_wall_lie_its_thickness_away(thickness: float) -> None:
    t = np.linspace(0.0, 1.0, 60)
    inner = np.column_stack([0.2 + 0.1 * np.sin(9.0 * t), t])
    outer = Wall(inner, thickness, 0.02).outer[1:]
    distance = np.linalg.norm(outer[:, None] - inner, axis=2).min(axis=1)
    assert (distance > 0.95 * thickness).all()
    assert (distance < 1.02 * thickness + 0.02).all()


def test_a_thick_neck_has_room_however_low_it_is() -> None:
    low = {"has_neck": True, "has_body_thickness": True, "body_thickness_val": 0.07, "neck_end_z": 0.0}
    for values in random_vases(600):
        parts = list(PROGRAM.parts({**values, **low, "handle_count": 0, "has_lid": False}))
        assert part(parts, "neck").mesh.volume > 0.0


def test_a_thick_wall_is_seen_under_a_lid() -> None:
    plain, thick = vase(has_lid=True), vase(has_lid=True, has_body_thickness=True)
    assert np.ptp(part(thick, "body").mesh.bounds[:, 0]) > np.ptp(part(plain, "body").mesh.bounds[:, 0]) + 0.05


def test_a_lid_is_wider_than_the_opening_and_lies_on_the_rim() -> None:
    for values in random_vases(100):
        settled = {**values, "has_lid": True, "body_profile_blend": 1.0}
        parts = list(PROGRAM.parts(settled))
        lid = part(parts, "lid").mesh
        rim = part(parts, "neck" if values["has_neck"] else "body").mesh
        opening = np.hypot(*rim.vertices[rim.vertices[:, 1] > rim.bounds[1, 1] - 1e-6][:, [0, 2]].T).min()
        assert lid.bounds[1, 0] >= opening
        assert lid.bounds[0, 1] < rim.bounds[1, 1] < lid.bounds[1, 1]


def test_a_cross_section_reaches_from_a_square_to_a_circle() -> None:
    corner = [VesselSection(roundness).reach(45.0) for roundness in (0.0, 0.5, 1.0)]
    assert 1.414 > corner[0] > 1.3 > corner[1] > corner[2] == pytest.approx(1.0)
    for roundness in (0.0, 0.3, 1.0):
        assert VesselSection(roundness).reach(90.0) == pytest.approx(1.0)
