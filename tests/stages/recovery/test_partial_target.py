"""Partial scans of stools: the missing part costs nothing, parts that the scan should show do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from eval.recovery.robustness import CORRUPTIONS
from stages.programs.program import find_program
from stages.recovery.cloud_target import cloud_target
from stages.recovery.inputs import RecoveryInput
from stages.recovery.partial_target import PartialTarget, partial_target
from stages.recovery.recover import recover, recover_input
from stages.shape.arrays import FloatArray
from stages.training.recovery.clouds import Frame, frame_of
from stages.training.recovery.shapes import TEST_INTERVAL, random_training_shapes
from stages.training.recovery.surface import sample_points
from tests.stages.recovery.test_recover import SHIPPED_MODELS, STOOL, TALL, cloud_of, off_by

PARTS = STOOL.parts(TALL)


def partial_cloud(seed: int = 0) -> FloatArray:
    """The half of a stool on one side of an oblique plane."""
    cloud = cloud_of(TALL, n=3000, seed=seed)
    along = cloud @ np.array([0.8, -0.5, 0.3])
    return cloud[along >= np.median(along)]


def placed_target(cloud: FloatArray, size: float = 1.0, moved: float = 0.0) -> PartialTarget:
    """The target of a cloud at its position on the shape, scaled and moved."""
    frame = frame_of(cloud)
    where = Frame(frame.centre + moved, frame.size * size)
    box = np.array([cloud.min(axis=0), cloud.max(axis=0)])
    return replace(partial_target(cloud, np.random.default_rng(0)), frame=where, box=box)


def distance_of(cloud: FloatArray, size: float = 1.0, moved: float = 0.0) -> float:
    """The distance of the shape from the cloud at a position."""
    target = placed_target(cloud, size, moved)
    # the shape's own box, so that the cloud is not moved with it
    corners = np.concatenate([part.mesh.vertices for part in PARTS])
    return replace(target, box=np.array([corners.min(axis=0), corners.max(axis=0)])).compared(PARTS)[0]


def test_half_of_the_shape_itself_is_missing() -> None:
    target = placed_target(partial_cloud())
    distance, _ = target.compared(PARTS)
    assert distance < 3.0 * target.floor(PARTS, np.random.default_rng(1))
    assert target.missing(PARTS) == pytest.approx(0.5, abs=0.05)
    # to a whole cloud the same shape at the same place is far
    whole, _ = replace(cloud_target(partial_cloud(), np.random.default_rng(0)), frame=target.frame).compared(PARTS)
    assert whole > 5.0 * distance


def test_whole_cloud_has_no_missing_part() -> None:
    target = placed_target(cloud_of(TALL))
    assert target.missing(PARTS) < 0.01


def test_parts_that_the_scan_should_show_count() -> None:
    # half of the rail is there, and no other part is near
    bare = STOOL.parts({**TALL, "has_rail": False})
    distance, _ = placed_target(partial_cloud()).compared(PARTS)
    assert placed_target(partial_cloud()).compared(bare)[0] > 1.5 * distance


def test_other_positions_and_sizes_are_farther() -> None:
    cloud = partial_cloud()
    distance = distance_of(cloud)
    for size, moved in ((1.1, 0.0), (0.9, 0.0), (1.0, 0.05), (1.0, -0.05)):
        assert distance_of(cloud, size, moved) > 2.0 * distance


def test_partial_scan_finds_position_and_size() -> None:
    cloud = partial_cloud()
    placed = partial_target(cloud, np.random.default_rng(0)).aligned(PARTS)
    assert placed.frame.size == pytest.approx(frame_of(cloud).size, rel=0.03)
    np.testing.assert_allclose(placed.frame.centre, frame_of(cloud).centre, atol=0.03)


def test_partial_scan_is_recovered_and_reported() -> None:
    found = recover(partial_cloud() * 7.0 + 3.0, "tests.stages.programs.stool", up="y", budget=120)
    assert off_by(found.values, TALL) < 0.1
    assert found.missing == pytest.approx(0.5, abs=0.1)
    assert found.as_json()["partial"] is True
    assert any("the cloud is partial" in warning for warning in found.warnings)
    assert found.placement is not None
    # the stool is where the whole scan would have been
    whole = cloud_of(TALL) * 7.0 + 3.0
    there = cloud_of(found.values) @ found.placement[:3, :3].T + found.placement[:3, 3]
    np.testing.assert_allclose(there.min(axis=0), whole.min(axis=0), atol=0.5)
    np.testing.assert_allclose(there.max(axis=0), whole.max(axis=0), atol=0.5)


def test_whole_scan_is_not_called_partial() -> None:
    found = recover(cloud_of(TALL), "tests.stages.programs.stool", up="y", budget=120)
    assert found.missing == 0.0
    assert found.as_json()["partial"] is False
    assert not any("partial" in warning for warning in found.warnings)


def test_stick_is_no_part_of_a_stool() -> None:
    stick = np.stack([np.linspace(0.0, 1.0, 300), np.zeros(300), np.zeros(300)], axis=1)
    found = recover(stick, "tests.stages.programs.stool", up="y", budget=30)
    assert found.missing == 0.0
    assert any("unlike any stool" in warning for warning in found.warnings)


@pytest.mark.parametrize("program", ["chair", "table", "vase"])
def test_network_distinguishes_partial_from_otherwise_corrupted_clouds(program: str) -> None:
    made, rng = find_program(program), np.random.default_rng(5)
    shape = next(random_training_shapes(made, TEST_INTERVAL, rng))
    given = RecoveryInput("cloud", points=sample_points(shape.parts, 2048, rng))
    clouds = {
        "whole": given,
        **{how: corrupt(given, np.random.default_rng(1)) for how, corrupt in CORRUPTIONS["points"].items()},
    }
    missing = {
        how: recover_input(cloud, program, SHIPPED_MODELS, "y", 8, 0, turned=False).missing
        for how, cloud in clouds.items()
    }
    assert missing.pop("half missing") > 0.2
    assert not any(missing.values())
