"""The recovered shape is written where the scan is: in its frame, size and up axis."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from stages.model_files.read import read_model
from stages.programs.program import find_program
from stages.recovery.files import write_recovery
from stages.recovery.inputs import RecoveryInput
from stages.recovery.reading import read_inputs, surface_points
from stages.recovery.recover import recover
from stages.training.recovery.surface import sample_points
from tests.stages.model_files.one_table import write_one_table

CHAIR = find_program("chair")
CLOUD = sample_points(CHAIR.parts(CHAIR.schema.base), 2000, np.random.default_rng(0))
Z_UP = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
SIDEWAYS = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])


@pytest.mark.parametrize(
    ("rotation", "scale", "shift"),
    [
        (np.eye(3), 1.0, (0.0, 0.0, 0.0)),
        (np.eye(3), 1.0, (3.0, -7.0, 11.0)),
        (SIDEWAYS, 1000.0, (250.0, 0.0, -4000.0)),
        (Z_UP @ SIDEWAYS, 0.01, (5.0, 5.0, 5.0)),
        (Z_UP, 1.0, (691_000.0, 5_334_000.0, 512.0)),
    ],
    ids=["as it is", "moved", "turned, in millimetres", "z up, small", "z up, in map coordinates"],
)
def test_written_shape_lies_on_the_scan(
    rotation: np.ndarray, scale: float, shift: tuple[float, ...], tmp_path: Path
) -> None:
    from scipy.spatial import cKDTree

    scan = scale * CLOUD @ rotation.T + shift
    up = "y" if rotation[2, 1] == 0 else "z"
    result = recover(scan, "chair", up=up, budget=1)
    files = write_recovery(tmp_path, RecoveryInput("scan", points=scan), result)
    written = surface_points(read_model(tmp_path / "scan.glb"))
    size = np.ptp(scan, axis=0).max()
    to_scan, to_shape = cKDTree(scan).query(written)[0], cKDTree(written).query(scan)[0]
    assert max(to_scan.mean(), to_shape.mean()) < 0.02 * size
    np.testing.assert_allclose(written.min(axis=0), scan.min(axis=0), atol=0.02 * size)
    np.testing.assert_allclose(written.max(axis=0), scan.max(axis=0), atol=0.02 * size)
    described = json.loads(files[0].read_bytes())
    placement = np.array(described["placement"])
    assert np.linalg.det(placement[:3, :3]) > 0
    own = sample_points(CHAIR.parts(CHAIR.schema.base), 100, np.random.default_rng(1))
    assert cKDTree(scan).query(own @ placement[:3, :3].T + placement[:3, 3])[0].mean() < 0.03 * size


def test_one_table_in_every_format_is_one_cloud_and_one_result(tmp_path: Path) -> None:
    clouds = []
    for path in write_one_table(tmp_path):
        (read,) = read_inputs(path)
        assert isinstance(read, RecoveryInput), read
        assert read.points is not None
        clouds.append(read.points)
    for cloud in clouds:
        np.testing.assert_allclose(cloud, clouds[0], atol=1e-12)
    first, last = (recover(cloud, "table", up="y", budget=20).as_json() for cloud in (clouds[0], clouds[-1]))
    assert first["parameters"] == last["parameters"]
