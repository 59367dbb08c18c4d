"""`shapemill export` on a finished dataset."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from stages.package.reader import Dataset
from tests.command import shapemill


def test_chosen_samples_are_written_in_the_order_of_their_records(toy_folder: Path, tmp_path: Path) -> None:
    sample = list(Dataset.open(toy_folder).samples("test"))[-1]
    code, text = shapemill("export", "obj", toy_folder, "--key", sample.key, "--to", tmp_path)
    assert (code, [path.name for path in tmp_path.iterdir()]) == (0, [sample.key]), text
    lines = (tmp_path / sample.key / f"{sample.key}.obj").read_text(encoding="utf-8").splitlines()
    assert [line[2:] for line in lines if line.startswith("o ")] == [part["name"] for part in sample.record["parts"]]
    vertices = np.array([line.split()[1:] for line in lines if line.startswith("v ")], dtype=float)
    np.testing.assert_allclose([vertices.min(axis=0), vertices.max(axis=0)], sample.record["bounds"], atol=1e-6)


def test_every_sample_is_written_and_missing_units_are_named(toy_folder: Path, tmp_path: Path) -> None:
    code, text = shapemill("export", "mjcf", toy_folder, "--to", tmp_path, "--scale", "0.1")
    assert code == 0, text
    written = sorted(path.name for path in tmp_path.iterdir())
    assert written == sorted(sample.key for sample in Dataset.open(toy_folder))
    assert "state no unit: 0.1 m for a unit" in text
    hulls = list((tmp_path / written[0] / "meshes").glob("*-hull.obj"))
    assert trimesh.load_mesh(hulls[0]).extents.max() == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["stl"], "there is no format 'stl' to export to; formats are urdf, mjcf, usd, obj, structurenet"),
        (["urdf", "--key", "nobody"], "has no sample nobody"),
        (["urdf", "--links", "all"], "must be parts or bodies"),
    ],
)
def test_mistakes_are_named(toy_folder: Path, tmp_path: Path, arguments: list[str], message: str) -> None:
    code, text = shapemill("export", arguments[0], toy_folder, "--to", tmp_path / "out", *arguments[1:])
    assert code == 2
    assert message in text
    assert not (tmp_path / "out").exists()
