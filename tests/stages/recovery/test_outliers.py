"""Outliers of a scan are found, and clean clouds have hardly any."""

from __future__ import annotations

import numpy as np
import pytest

from eval.recovery.robustness import CORRUPTIONS
from stages.programs.program import find_program
from stages.recovery.inputs import RecoveryInput
from stages.recovery.outliers import find_outliers
from stages.recovery.recover import recover
from stages.shape.arrays import FloatArray
from stages.training.recovery.clouds import frame_of
from stages.training.recovery.surface import sample_points

CHAIR = find_program("chair")


def cloud_of_chair(n: int, seed: int = 0) -> FloatArray:
    return sample_points(CHAIR.parts(CHAIR.schema.base), n, np.random.default_rng(seed))


def corrupted(how: str, cloud: FloatArray) -> FloatArray:
    points = CORRUPTIONS["points"][how](RecoveryInput("cloud", points=cloud), np.random.default_rng(1)).points
    assert points is not None
    return points


@pytest.mark.parametrize("how", ["noise of 1 %", "half missing", "uneven", "300 points"])
def test_clouds_without_outliers_are_unchanged(how: str) -> None:
    assert not find_outliers(cloud_of_chair(2048)).any()
    assert find_outliers(corrupted(how, cloud_of_chair(2048))).mean() < 0.03


def test_outliers_are_found_and_the_box_is_that_of_the_shape() -> None:
    clean = cloud_of_chair(2048)
    cloud = corrupted("5 % outliers", clean)
    outliers = find_outliers(cloud)
    count = len(clean) // 20
    assert outliers[-count:].mean() > 0.8
    assert outliers[:-count].mean() < 0.01
    size = frame_of(clean).size
    assert frame_of(cloud).size > 1.1 * size
    assert abs(frame_of(cloud[~outliers]).size - size) < 0.05 * size


def test_coincident_points_count_once() -> None:
    cloud = cloud_of_chair(600)
    assert not find_outliers(np.concatenate([cloud, *[cloud[:50]] * 6])).any()
    assert not find_outliers(np.zeros((40, 3))).any()


def test_warning_has_the_number_of_outliers() -> None:
    cloud = corrupted("5 % outliers", cloud_of_chair(2048))
    found = recover(cloud, "chair", up="y", budget=1)
    assert f"{int(find_outliers(cloud).sum())} points of the cloud are outliers" in " ".join(found.warnings)
    assert "outliers" not in " ".join(recover(cloud_of_chair(2048), "chair", up="y", budget=1).warnings)
