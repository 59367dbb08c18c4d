"""Torn scans of stools: what is missing costs nothing, what should be there does."""

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
from stages.training.recovery.shapes import TEST_INTERVAL, random_shapes
from stages.training.recovery.surface import sample_points
from tests.stages.recovery.test_recover import SHIPPED_MODELS, STOOL, TALL, cloud_of, off_by

PARTS = STOOL.parts(TALL)


def torn(seed: int = 0) -> FloatArray:
    """The half of a stool on one side of a leaning plane."""
    cloud = cloud_of(TALL, n=3000, seed=seed)
    along = cloud @ np.array([0.8, -0.5, 0.3])
    return cloud[along >= np.median(along)]


def at(cloud: FloatArray, size: float = 1.0, moved: float = 0.0) -> PartialTarget:
    """The target of a cloud that stands where it was taken from the shape, but for its size and place."""
    frame = frame_of(cloud)
    where = Frame(frame.centre + moved, frame.size * size)
    box = np.array([cloud.min(axis=0), cloud.max(axis=0)])
    return replace(partial_target(cloud, np.random.default_rng(0)), frame=where, box=box)


def standing(cloud: FloatArray, size: float = 1.0, moved: float = 0.0) -> float:
    """How far the shape is from the cloud as it stands."""
    target = at(cloud, size, moved)
    # the shape's own box, so that the cloud is not moved with it
    corners = np.concatenate([part.mesh.vertices for part in PARTS])
    return replace(target, box=np.array([corners.min(axis=0), corners.max(axis=0)])).compared(PARTS)[0]


def test_the_shape_itself_explains_half_of_it_and_half_is_missing() -> None:
    target = at(torn())
    distance, _ = target.compared(PARTS)
    assert distance < 3.0 * target.floor(PARTS, np.random.default_rng(1))
    assert target.missing(PARTS) == pytest.approx(0.5, abs=0.05)
    # to a whole cloud the same shape at the same place is far
    whole, _ = replace(cloud_target(torn(), np.random.default_rng(0)), frame=target.frame).compared(PARTS)
    assert whole > 5.0 * distance


def test_of_a_whole_cloud_nothing_is_missing() -> None:
    target = at(cloud_of(TALL))
    assert target.missing(PARTS) < 0.01


def test_what_the_scan_should_show_counts() -> None:
    # half of the rail is there, and no other part is near
    bare = STOOL.parts({**TALL, "has_rail": False})
    distance, _ = at(torn()).compared(PARTS)
    assert at(torn()).compared(bare)[0] > 1.5 * distance


def test_other_places_and_sizes_are_farther() -> None:
    cloud = torn()
    distance = standing(cloud)
    for size, moved in ((1.1, 0.0), (0.9, 0.0), (1.0, 0.05), (1.0, -0.05)):
        assert standing(cloud, size, moved) > 2.0 * distance


def test_a_torn_scan_finds_where_it_stands_and_how_large_the_shape_is() -> None:
    cloud = torn()
    placed = partial_target(cloud, np.random.default_rng(0)).aligned(PARTS)
    assert placed.frame.size == pytest.approx(frame_of(cloud).size, rel=0.03)
    np.testing.assert_allclose(placed.frame.centre, frame_of(cloud).centre, atol=0.03)


def test_a_torn_scan_is_recovered_and_told() -> None:
    found = recover(torn() * 7.0 + 3.0, "tests.stages.programs.stool", up="y", budget=120)
    assert off_by(found.values, TALL) < 0.1
    assert found.missing == pytest.approx(0.5, abs=0.1)
    assert found.as_json()["partial"] is True
    assert any("the cloud is partial" in each for each in found.warnings)
    assert found.placement is not None
    # the stool is where the whole scan would have been
    whole = cloud_of(TALL) * 7.0 + 3.0
    there = cloud_of(found.values) @ found.placement[:3, :3].T + found.placement[:3, 3]
    np.testing.assert_allclose(there.min(axis=0), whole.min(axis=0), atol=0.5)
    np.testing.assert_allclose(there.max(axis=0), whole.max(axis=0), atol=0.5)


def test_a_whole_scan_is_not_called_partial() -> None:
    found = recover(cloud_of(TALL), "tests.stages.programs.stool", up="y", budget=120)
    assert found.missing == 0.0
    assert found.as_json()["partial"] is False
    assert not any("partial" in each for each in found.warnings)


def test_a_stick_is_no_part_of_a_stool() -> None:
    stick = np.stack([np.linspace(0.0, 1.0, 300), np.zeros(300), np.zeros(300)], axis=1)
    found = recover(stick, "tests.stages.programs.stool", up="y", budget=30)
    assert found.missing == 0.0
    assert any("unlike any stool" in each for each in found.warnings)


@pytest.mark.parametrize("program", ["chair", "table", "vase"])
def test_a_network_tells_torn_clouds_from_clouds_that_are_spoilt_otherwise(program: str) -> None:
    made, rng = find_program(program), np.random.default_rng(5)
    shape = next(random_shapes(made, TEST_INTERVAL, rng))
    given = RecoveryInput("cloud", points=sample_points(shape.parts, 2048, rng))
    clouds = {
        "whole": given,
        **{how: spoil(given, np.random.default_rng(1)) for how, spoil in CORRUPTIONS["points"].items()},
    }
    missing = {
        how: recover_input(each, program, SHIPPED_MODELS, "y", 30, 0, turned=False).missing
        for how, each in clouds.items()
    }
    assert missing.pop("half missing") > 0.2
    assert not any(missing.values())
