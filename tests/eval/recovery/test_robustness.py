"""Recovery of corrupted and external inputs, on stools."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from eval.engine.dataset_run import load_dataset_run
from eval.recovery.methods import apply_method, methods
from eval.recovery.robustness import (
    CORRUPTIONS,
    corrupted_inputs,
    corruption_names,
    corruption_table,
    external_inputs,
    external_rows,
    external_table,
)
from eval.tables.recovery_robustness import RecoveryRobustnessOptions, _sections
from pipeline.errors import ConfigError
from stages.recovery.inputs import RecoveryInput
from stages.training.recovery.clouds import frame_of
from stages.training.recovery.shapes import TEST_INTERVAL, random_training_shapes
from stages.training.recovery.surface import sample_points
from tests.eval.recovery.test_methods import STOOL, model

CHAIRS = Path(__file__).resolve().parents[3] / "configs" / "chairs.yaml"


def cloud(n: int = 2000) -> np.ndarray:
    shape = next(random_training_shapes(STOOL, TEST_INTERVAL, np.random.default_rng(0)))
    return sample_points(shape.parts, n, np.random.default_rng(0))


def test_corruptions_of_clouds_have_their_named_effect() -> None:
    points = cloud()
    corrupted = {
        name: corrupted_inputs(model(), name, [], [RecoveryInput("one", points)], 3)[0].points
        for name in CORRUPTIONS["points"]
    }
    noise = (corrupted["noise of 1 %"] - points) / frame_of(points).size
    assert noise.std() == pytest.approx(0.01, rel=0.1)
    outliers = ~np.isin(corrupted["5 % outliers"], points).all(axis=1)
    assert outliers.sum() == 100
    assert len(corrupted["half missing"]) == pytest.approx(1000, abs=1)
    assert 900 < len(corrupted["uneven"]) < 1200
    assert len(corrupted["300 points"]) == 300
    assert np.isin(corrupted["half missing"], points).all()
    # what is left lies on one side of a plane
    gone = points[~np.isin(points[:, 0], corrupted["half missing"][:, 0])]
    assert not np.allclose(gone.mean(axis=0), corrupted["half missing"].mean(axis=0), atol=0.05)


def test_corruptions_of_drawings_have_their_named_effect() -> None:
    ink = np.zeros((224, 224), np.bool_)
    ink[100, 20:200] = ink[20:200, 60] = True
    drawer = model(input="sketch")
    corrupted = {
        name: corrupted_inputs(drawer, name, [], [RecoveryInput("one", ink=ink)], 3)[0].ink
        for name in CORRUPTIONS["sketch"]
    }
    assert 4.0 < corrupted["thick lines"].sum() / ink.sum() < 5.5
    assert (corrupted["thick lines"] & ink).sum() == ink.sum()
    assert not (corrupted["broken lines"] & ~ink).any()
    assert 0.4 < corrupted["broken lines"].sum() / ink.sum() < 0.9
    assert 0.7 < corrupted["wobbly lines"].sum() / ink.sum() <= 1.0
    assert (corrupted["wobbly lines"] & ink).sum() < 0.5 * ink.sum()


def test_corruption_depends_on_seed_alone() -> None:
    given = [RecoveryInput("one", cloud(350)), RecoveryInput("two", cloud(400))]
    for name in corruption_names("points"):
        first, second, other = (corrupted_inputs(model(), name, [], given, seed) for seed in (1, 1, 2))
        for cloud_of_seed, again, differs in zip(first, second, other, strict=True):
            assert np.array_equal(cloud_of_seed.points, again.points)
            assert not np.array_equal(cloud_of_seed.points, differs.points)


def test_tables_have_a_row_per_method(tmp_path: Path) -> None:
    trained = model()
    shape = next(random_training_shapes(STOOL, TEST_INTERVAL, np.random.default_rng(0)))
    corrupted = corrupted_inputs(trained, "half missing", [shape], [RecoveryInput("one", cloud())], 0)
    method = methods(trained, 10, 0)["network"]
    table = corruption_table([apply_method("stool, half missing: network", STOOL, method, [shape], corrupted)])
    assert table.rows[0][0] == "stool, half missing: network"
    assert table.rows[0][1] == 1
    assert table.rows[0][2] > 0
    np.save(tmp_path / "strange.npy", cloud() @ np.diag([2.0, 1.0, 1.0]))
    inputs = external_inputs(tmp_path, "points")
    assert not external_inputs(tmp_path, "sketch")
    rows = external_rows(trained, inputs, 40, 0)
    table = external_table(rows)
    assert [row[0] for row in table.rows] == ["base shape", "network", "network, refined"]
    assert table.rows[2][2] < table.rows[0][2]


def test_unreadable_external_file_is_reported(tmp_path: Path) -> None:
    np.save(tmp_path / "one.npy", np.zeros((1, 3)))
    with pytest.raises(ConfigError, match="has 1 point"):
        external_inputs(tmp_path, "points")


def test_external_shapes_are_sections_of_their_own(tmp_path: Path) -> None:
    folder = tmp_path / "scans"
    folder.mkdir()
    np.save(folder / "one.npy", cloud(400))
    run = load_dataset_run(CHAIRS, tmp_path)

    def names(corrupted: int, *external: Path) -> list[str]:
        options = RecoveryRobustnessOptions(programs=("chair",), corrupted=corrupted, external=external)
        return [section.name for section in _sections(run, options)]

    assert names(0, folder) == ["chair, points, from scans"]
    assert names(2) == [f"chair, {kind}, {name}" for kind in ("points", "sketch") for name in corruption_names(kind)]
    assert len(set(names(2, folder))) == 11
