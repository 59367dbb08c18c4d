"""Scans and least numbers of points a part: what they hold, and what `make verify` says of damaged ones."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pipeline.errors import Rejected
from pipeline.shards import bytes_array
from stages.points.audit import AUDIT
from stages.points.cloud import sample_cloud
from stages.points.settings import PointsConfig, ScansConfig
from stages.points.stage import point_members
from stages.shape.collection.packaged import PackagedSample
from stages.shape.geometry.bounds import shape_bounds
from stages.shape.kit import Assembly
from stages.shape.shape import Shape, kit_shape
from stages.views.settings import PosedCameras, RingCameras
from tests.stages.shape.views.solids import box, cylinder, kit_of, part_type, posed


def parts_in_a_row(*offsets: float, small: float = 0.05) -> Shape:
    """A box, a drum and a small box, at places along x."""
    kit = kit_of(
        part_type("box", box()),
        part_type("drum", cylinder(24, 0.5, 1.0)),
        part_type("knob", box((small, small, small))),
    )
    types = np.array([0, 1, 2], np.int16)[: len(offsets)]
    return kit_shape(kit, Assembly(types, posed(*[(x, 0, 0) for x in offsets]), np.empty((0, 2), np.int32)))


def scanned(shape: Shape, config: PointsConfig, seed: int = 1) -> PackagedSample:
    """A sample as packaged, with the members of stage `points`."""

    def stream(*place: Any) -> np.random.Generator:
        return np.random.default_rng([seed, *(len(word) if isinstance(word, str) else word for word in place)])

    members = point_members(shape, config, stream)
    record = {**json.loads(members.pop("json")), "bounds": shape_bounds(shape).tolist()}
    arrays = {name: bytes_array(content) for name, content in members.items()}
    return PackagedSample("a", record, members, arrays, shape, {})


def faults(sample: PackagedSample) -> list[str]:
    return list(AUDIT.faults(sample))


FRONT = RingCameras(count=1, elevation=0.0)
"""One camera that looks along -z."""


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize("normalize", ["none", "unit_sphere"])
def test_a_scan_has_no_faults(projection: Any, noise: float, normalize: Any) -> None:
    cameras = RingCameras(count=3, projection=projection)
    scans = ScansConfig(count=2, points=300, cameras=(cameras,), depth_noise=noise)
    sample = scanned(parts_in_a_row(99.0, 100.0, 101.0), PointsConfig(uniform=50, normalize=normalize, scans=scans))
    assert faults(sample) == []
    assert set(sample.arrays["scan_cameras1.npy"].tolist()) == {0, 1, 2}
    assert (sample.arrays["scan_points0.npy"] != sample.arrays["scan_points1.npy"]).any()


def test_a_camera_in_front_of_a_box_sees_its_front_alone() -> None:
    scans = ScansConfig(points=200, cameras=(FRONT,))
    sample = scanned(parts_in_a_row(0.0), PointsConfig(uniform=1, scans=scans))
    np.testing.assert_allclose(sample.arrays["scan_points0.npy"][:, 2], 0.5, atol=1e-6)
    np.testing.assert_allclose(sample.arrays["scan_normals0.npy"], np.tile([0.0, 0.0, 1.0], (200, 1)), atol=1e-6)
    pose = np.array(sample.record["scans"][0]["cameras"][0]["world_to_camera"])
    assert (-pose[:3, :3].T @ pose[:3, 3])[2] > 0.5


def test_noise_is_normal_along_the_ray_and_cut_at_four_deviations() -> None:
    cameras = RingCameras(count=1, elevation=0.0, projection="orthographic")
    scans = ScansConfig(points=20_000, cameras=(cameras,), depth_noise=0.02)
    sample = scanned(parts_in_a_row(0.0), PointsConfig(uniform=1, scans=scans))
    deviation = sample.record["scans"][0]["depth_noise"]
    assert deviation == pytest.approx(0.02 * np.sqrt(0.75))
    errors = (sample.arrays["scan_points0.npy"][:, 2] - 0.5) / deviation
    assert errors.std() == pytest.approx(1.0, abs=0.03)
    assert np.abs(errors).max() <= 4.0 + 1e-3
    assert (np.abs(errors) < 1.0).mean() == pytest.approx(0.6827, abs=0.015)
    assert np.abs(sample.arrays["scan_points0.npy"][:, :2]).max() <= 0.5 + 1e-6


def test_a_shape_outside_all_pictures_is_rejected() -> None:
    """A thin long rod seen at its middle by a narrow camera from its end is hit; two far knobs aside are not."""
    ahead = ((1.0, 0.0, 0.0, 0.0), (0.0, -1.0, 0.0, 0.0), (0.0, 0.0, -1.0, 3.0), (0.0, 0.0, 0.0, 1.0))
    shape = parts_in_a_row(-50.0, 0.0, 50.0)
    apart = replace(
        shape, assembly=Assembly(np.array([2, 2], np.int16), posed((-9, 0, 0), (9, 0, 0)), np.empty((0, 2)))
    )
    scans = ScansConfig(points=10, cameras=(PosedCameras(fov=2.0, poses=(ahead,)),))
    with pytest.raises(Rejected, match="only 0 meet the shape"):
        scanned(apart, PointsConfig(uniform=10, scans=scans))


def other(value: Any) -> Callable[[np.ndarray], np.ndarray]:
    return lambda array: np.full_like(array, value)


@pytest.mark.parametrize(
    ("member", "change", "found"),
    [
        ("scan_points0.npy", lambda points: points + np.float32(0.5), "farther from their part than the noise allows"),
        ("scan_points0.npy", lambda points: points * np.float32([1, 1, -1]), "are hidden from their camera"),
        ("scan_normals0.npy", lambda normals: -normals, "300 of its 300 normals"),
        ("scan_labels0.npy", other(7), "not the classes of their parts"),
        ("scan_cameras0.npy", other(1), "name cameras that do not exist"),
        ("scan_instances0.npy", other(3), "name parts that do not exist"),
        ("points1.npy", lambda points: points + np.float32(5), "cloud 1: 50 of its 50 points are not on the surface"),
    ],
)
def test_damaged_scans_are_found(member: str, change: Callable[[np.ndarray], np.ndarray], found: str) -> None:
    scans = ScansConfig(points=300, cameras=(FRONT,))
    good = scanned(parts_in_a_row(0.0, 1.5), PointsConfig(uniform=50, clouds=2, scans=scans))
    damaged = faults(replace(good, arrays={**good.arrays, member: change(good.arrays[member])}))
    assert [found in fault for fault in damaged] == [True]


@pytest.mark.parametrize("claimed", [0.5, 2.0])
def test_noise_of_another_spread_is_found(claimed: float) -> None:
    scans = ScansConfig(points=1000, cameras=(FRONT,), depth_noise=0.01)
    good = scanned(parts_in_a_row(0.0), PointsConfig(uniform=1, scans=scans))
    scan = {**good.record["scans"][0], "depth_noise": claimed * good.record["scans"][0]["depth_noise"]}
    (fault,) = faults(replace(good, record={**good.record, "scans": [scan]}))
    assert ("standard deviation" if claimed > 1 else "than the noise allows") in fault


@pytest.mark.parametrize("surface", ["all", "visible"])
def test_small_parts_get_the_least_number_of_points_and_the_count_stays(surface: Any) -> None:
    shape = parts_in_a_row(0.0, 1.5, 3.0)
    plain = sample_cloud(shape, 200, 0, 1, surface, np.random.default_rng(3))
    filled = sample_cloud(shape, 200, 0, 1, surface, np.random.default_rng(3), min_per_part=20)
    assert np.bincount(plain.instances, minlength=3)[2] < 20
    assert len(filled.points) == 200
    assert np.bincount(filled.instances, minlength=3).tolist()[2] == 20
    kept = (filled.points == plain.points).all(axis=1)
    assert kept.sum() == 200 - (20 - np.bincount(plain.instances, minlength=3)[2])


def test_a_hidden_part_gets_no_points_of_a_visible_surface() -> None:
    shape = parts_in_a_row(0.0, 1.5, 0.0)
    counts = np.bincount(
        sample_cloud(shape, 200, 0, 1, "visible", np.random.default_rng(3), min_per_part=20).instances, minlength=3
    )
    assert counts.tolist()[2] == 0
    assert counts.sum() == 200


def test_a_shape_of_many_parts_gets_an_equal_share_that_its_record_states() -> None:
    sample = scanned(parts_in_a_row(0.0, 1.5, 3.0), PointsConfig(uniform=50, farthest=9, min_per_part=40))
    assert sample.record["points"]["min_per_part"] == 16
    assert np.bincount(sample.arrays["instances.npy"][9:]).min() == 16
    assert faults(sample) == []
    lacking = {**sample.record, "points": {**sample.record["points"], "min_per_part": 17}}
    assert faults(replace(sample, record=lacking)) == ["a part has 16 points, fewer than the 17 of its json"]


def test_the_first_cloud_does_not_depend_on_further_ones() -> None:
    shape = parts_in_a_row(0.0, 1.5)
    one, more = (scanned(shape, PointsConfig(uniform=30, farthest=5, clouds=count)).arrays for count in (1, 3))
    assert [name for name in more if name.startswith("points")] == ["points.npy", "points1.npy", "points2.npy"]
    assert (one["points.npy"] == more["points.npy"]).all()
    assert (more["points1.npy"] != more["points2.npy"]).any()


def test_a_minimum_above_the_number_of_points_is_refused() -> None:
    with pytest.raises(ValueError, match="min_per_part \\(20\\) is more than uniform \\(10\\)"):
        PointsConfig(uniform=10, min_per_part=20)
