"""What `make verify` finds wrong with the points of a sample, and that it finds nothing wrong with good ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, get_args

import numpy as np
import pytest

from stages.points.audit import AUDIT
from stages.points.cloud import NormalizeMode, normalization, sample_cloud
from stages.points.settings import SampledSurface
from stages.points.visibility import seen_from_outside
from stages.shape.collection.packaged import PackagedSample
from stages.shape.geometry.bounds import shape_bounds
from stages.shape.kit import Assembly
from stages.shape.shape import kit_shape
from tests.stages.shape.views.solids import box, cylinder, kit_of, part_type, posed


def sample(mode: NormalizeMode = "none", surface: SampledSurface = "all") -> PackagedSample:
    """A row of parts that reach into each other, a hundred away from the origin; the class of a part is its type and
    5."""
    kit = kit_of(part_type("box", box()), part_type("drum", cylinder(24, 0.5, 1.0)))
    types = np.array([0, 1, 0], np.int16)
    shape = kit_shape(kit, Assembly(types, posed((99, 0, 0), (100, 0, 0), (100.3, 0, 0)), np.empty((0, 2), np.int32)))
    cloud, moved = sample_cloud(shape, 60, 20, 100, surface, np.random.default_rng(1)), normalization(shape, mode)
    made = {"farthest": 20, "uniform": 60, "surface": surface, "centre": list(moved.centre), "scale": moved.scale}
    parts = [{"class": int(kind) + 5} for kind in types]
    arrays = {
        "points.npy": ((cloud.points - moved.centre) * moved.scale).astype(np.float32),
        "normals.npy": cloud.normals.astype(np.float32),
        "labels.npy": cloud.labels + np.int16(5),
        "instances.npy": cloud.instances,
    }
    record = {"points": made, "parts": parts, "bounds": shape_bounds(shape).tolist()}
    return PackagedSample("a", record, {}, arrays, replace(shape, class_ids=tuple(range(5, 5 + len(shape.labels)))), {})


@pytest.mark.parametrize("surface", get_args(SampledSurface))
@pytest.mark.parametrize("mode", get_args(NormalizeMode))
def test_good_points_have_no_faults(mode: NormalizeMode, surface: SampledSurface) -> None:
    assert list(AUDIT.faults(sample(mode, surface))) == []


def test_points_that_cannot_be_seen_are_found() -> None:
    every = sample()
    claimed = {**every.record, "points": {**every.record["points"], "surface": "visible"}}
    points, normals = (every.arrays[f"{name}.npy"].astype(float) for name in ("points", "normals"))
    hidden = ~seen_from_outside(every.rays, points, normals)
    x, y, z = (points - [100.0, 0.0, 0.0]).T
    in_box = (np.abs([x - 0.3, y, z]) < 0.49).all(axis=0)
    in_drum = (np.hypot(x, z) < 0.49) & (np.abs(y) < 0.49)
    assert (in_box | in_drum).sum() >= 10
    assert hidden[in_box | in_drum].all()
    (fault,) = AUDIT.faults(replace(every, record=claimed))
    count, _, rest = fault.partition(" ")
    assert rest == "of its 80 points cannot be seen from outside"
    # Surfaces seen only nearly edge-on are left out of clouds, which is not a fault.
    assert (in_box | in_drum).sum() <= int(count) <= hidden.sum()


def at_first(value: Any) -> Callable[[np.ndarray], np.ndarray]:
    def change(array: np.ndarray) -> np.ndarray:
        array = array.copy()
        array[0] = value
        return array

    return change


@pytest.mark.parametrize(
    ("member", "change", "found"),
    [
        ("points.npy", lambda points: points + np.float32(5), "80 of its 80 points are not on the surface"),
        ("points.npy", at_first(50.0), "1 of its 80 points are not on the surface"),
        ("points.npy", lambda points: points[1:], "lengths of its point arrays differ"),
        ("normals.npy", lambda normals: -normals, "80 of its 80 normals are not those of their part"),
        ("normals.npy", lambda normals: np.concatenate([-normals[:1], normals[1:]]), "1 of its 80 normals"),
        ("normals.npy", lambda normals: normals * np.float32(1.01), "unit length"),
        ("labels.npy", lambda labels: labels - np.int16(1), "not the classes of their parts"),
        ("instances.npy", at_first(3), "do not exist"),
        ("instances.npy", at_first(-1), "do not exist"),
    ],
)
def test_damaged_points_are_found(member: str, change: Callable[[np.ndarray], np.ndarray], found: str) -> None:
    good = sample()
    arrays = {**good.arrays, member: change(good.arrays[member])}
    faults = list(AUDIT.faults(replace(good, arrays=arrays)))
    assert [found in fault for fault in faults] == [True]
