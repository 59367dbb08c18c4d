"""The table of worth from the command line, on models of a folder."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from eval.worth.labelled_clouds import model_clouds
from eval.worth.real_sets import PROGRAMS, real_sets
from eval.worth.rows import Training, network_tables
from pipeline.errors import ConfigError
from pipeline.shards import ShardWriter, array_bytes
from stages.model_files.folder import model_files
from tests.command import shapemill

SHARED = Path(__file__).resolve().parents[3].parent / "shared"


def write_dataset(folder: Path, samples: int) -> None:
    """Write the files of a finished dataset that the table reads: clouds of two cubes, one on the other."""
    (folder / "data" / "train").mkdir(parents=True)
    rng = np.random.default_rng(0)
    with (folder / "data" / "train" / "tiny-train-000000.tar").open("wb") as stream, ShardWriter(stream) as writer:
        for number in range(samples):
            points = rng.random((64, 3)) * [1.0, 2.0, 1.0]
            instances = (points[:, 1] > 1.0).astype(np.int16)
            arrays = {"points.npy": array_bytes(points), "instances.npy": array_bytes(instances)}
            writer.write(f"tiny-{number}", {"json": b"{}", **arrays})
    counts = {"samples": samples, "splits": {"train": samples}, "kits": {"tiny": samples}}
    manifest = {"name": "tiny", "version": "1", "seed": 1, "software": {"shapemill": "0"}, **counts}
    (folder / "manifest.json").write_text(json.dumps(manifest), encoding="utf-8")
    (folder / "classes.json").write_text("[]", encoding="utf-8")
    (folder / "checksums.txt").write_text("", encoding="utf-8")


@pytest.fixture(scope="module")
def models(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six tables of five parts, a mesh in one piece, and a file that is no model."""
    folder = tmp_path_factory.mktemp("furniture")
    for number in range(6):
        scene = trimesh.Scene()
        top = trimesh.creation.box((2.0 + 0.2 * number, 0.1, 1.0))
        scene.add_geometry(top, node_name="top", geom_name="top")
        for leg, (x, z) in enumerate(((-0.9, -0.4), (-0.9, 0.4), (0.9, -0.4), (0.9, 0.4))):
            mesh = trimesh.creation.box((0.1, 1.0, 0.1))
            mesh.apply_translation((x, -0.55, z))
            scene.add_geometry(mesh, node_name=f"leg.{leg}", geom_name=f"leg{leg}")
        scene.export(folder / f"table{number}.glb")
    trimesh.creation.icosphere(1).export(folder / "ball.stl")
    (folder / "broken.glb").write_bytes(b"no model")
    return folder


def test_models_without_parts_and_unreadable_ones_are_counted(models: Path) -> None:
    files = model_files(models)
    clouds, skipped = model_clouds(files, "auto", 50, 128, np.random.default_rng(0))
    assert (len(clouds), skipped.unreadable, skipped.without_parts) == (6, 1, 1)
    assert clouds.points.shape == (6, 128, 3)
    np.testing.assert_allclose(np.linalg.norm(np.ptp(clouds.points, axis=1), axis=1), 1, atol=1e-5)
    assert all(len(np.unique(parts)) == 5 for parts in clouds.parts)
    # legs are below the top
    for points, parts in zip(clouds.points, clouds.parts, strict=True):
        top = np.bincount(parts)[parts].argmax()
        assert points[parts == parts[top], 1].min() >= points[parts != parts[top], 1].max() - 1e-5


def test_folder_without_models_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="holds 0 models to test on; name a folder of at least 2"):
        real_sets(tmp_path, tmp_path, "auto", 3, 2, 1)


def test_rows_are_made_kept_and_read_again(models: Path, tmp_path: Path) -> None:
    config = tmp_path / "tiny.yaml"
    config.write_text("name: tiny\nseed: 1\nprimitives: {samples: 10}\n", encoding="utf-8")
    write_dataset(tmp_path / "tiny", 10)
    settings = {"shared": tmp_path / "absent", "shapes": 8, "steps": 1, "labelled": [0, 2], "labelled_steps": 1}
    table = ["eval", "worth", "--config", config, "--out", tmp_path]
    table += [f"--set={key}={value}" for key, value in settings.items()]

    code, printed = shapemill(*table)
    assert code == 0, printed
    assert "There are no real shapes to test on" in printed

    table += [f"--set=models={models}", "--set=test_shapes=5"]
    code, printed = shapemill(*table)
    assert code == 0, printed
    assert "6 of 8 models were taken; 1 others cannot be read, and 1 have no parts." in printed
    rows = list(csv.reader((tmp_path / "tiny-eval" / "worth.csv").open(encoding="utf-8")))
    assert [row[0] for row in rows] == ["learnt from", "distance of points", "random weights", "tiny"]
    assert rows[0][2:] == [models.name, f"{models.name} ±"]
    assert rows[3][1] == "8"
    assert all(0 < float(row[2]) <= 100 for row in rows[1:])
    labelled = list(csv.reader((tmp_path / "tiny-eval" / "worth_2.csv").open(encoding="utf-8")))
    assert [row[0] for row in labelled] == ["learnt from", "random weights", "tiny"]

    code, printed = shapemill(*table)
    assert code == 0, printed
    assert printed.count(": cached") == 3
    code, printed = shapemill(*table, f"--set=datasets=[{tmp_path / 'other'}]")
    assert code == 2
    assert "is no finished dataset" in printed


def test_test_shapes_of_published_programs_are_of_the_validation_split() -> None:
    if not (SHARED / PROGRAMS).is_file():
        pytest.skip("needs the published programs")
    chairs = next(real for real in real_sets(SHARED, None, "auto", 3, 2, 1) if real.name == "chair")
    tested, labelled, note = chairs.read()
    assert (tested.points.shape, labelled.points.shape, note) == ((3, 1024, 3), (2, 2048, 3), "")
    assert all(len(np.unique(parts)) > 2 for parts in tested.parts)


def test_categories_are_recognised_where_there_are_two() -> None:
    if not (SHARED / PROGRAMS).is_file():
        pytest.skip("needs the published programs")
    sets = [real for real in real_sets(SHARED, None, "auto", 4, 3, 1) if real.name in ("chair", "storage")]
    training = Training(steps=1, labelled=(0, 3), labelled_steps=1, repetitions=1, ways=(), seed=1)
    without, labelled = network_tables("random weights", None, sets, sets, training)
    columns = ("learnt from", "shapes", "chair", "chair ±", "storage", "storage ±")
    assert (without.columns, labelled.columns) == (columns, (*columns, "category", "category ±"))
    assert labelled.rows[0][6] in [100 * right / 8 for right in range(9)]
    (one_category,) = network_tables("random weights", None, sets[:1], sets[:1], replace(training, labelled=(3,)))
    assert one_category.columns == columns[:4]
    (one_tested,) = network_tables("real furniture", None, sets[:1], sets, replace(training, labelled=(3,)))
    assert one_tested.rows[0][4:] == ("", "", "", "")
