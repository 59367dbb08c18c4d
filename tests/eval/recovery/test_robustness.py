"""Recovery of spoilt and foreign inputs, on stools."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

import numpy as np
import pytest

from eval.engine.dataset_run import load_dataset_run
from eval.recovery.accuracy import methods, tried
from eval.recovery.robustness import (
    CORRUPTIONS,
    foreign_inputs,
    foreign_rows,
    foreign_table,
    spoilt_inputs,
    spoilt_table,
    ways_to_spoil,
)
from eval.tables.recovery_robustness import _parts
from pipeline.errors import ConfigError
from stages.recovery.inputs import RecoveryInput
from stages.training.recovery.clouds import frame_of
from stages.training.recovery.shapes import TEST_INTERVAL, random_shapes
from stages.training.recovery.surface import sample_points
from tests.eval.recovery.test_accuracy import STOOL, model

CHAIRS = Path(__file__).resolve().parents[2] / "configs" / "chairs.yaml"


def cloud(n: int = 2000) -> np.ndarray:
    shape = next(random_shapes(STOOL, TEST_INTERVAL, np.random.default_rng(0)))
    return sample_points(shape.parts, n, np.random.default_rng(0))


def test_clouds_are_spoilt_as_they_are_said_to_be() -> None:
    points = cloud()
    spoilt = {
        how: spoilt_inputs(model(), how, [], [RecoveryInput("one", points)], 3)[0].points
        for how in CORRUPTIONS["points"]
    }
    noise = (spoilt["noise of 1 %"] - points) / frame_of(points).size
    assert noise.std() == pytest.approx(0.01, rel=0.1)
    strays = ~np.isin(spoilt["5 % outliers"], points).all(axis=1)
    assert strays.sum() == 100
    assert len(spoilt["half missing"]) == pytest.approx(1000, abs=1)
    assert 900 < len(spoilt["uneven"]) < 1200
    assert len(spoilt["300 points"]) == 300
    assert np.isin(spoilt["half missing"], points).all()
    # what is left lies on one side of a plane
    gone = points[~np.isin(points[:, 0], spoilt["half missing"][:, 0])]
    assert not np.allclose(gone.mean(axis=0), spoilt["half missing"].mean(axis=0), atol=0.05)


def test_drawings_are_spoilt_as_they_are_said_to_be() -> None:
    ink = np.zeros((224, 224), np.bool_)
    ink[100, 20:200] = ink[20:200, 60] = True
    drawer = model(input="sketch")
    spoilt = {
        how: spoilt_inputs(drawer, how, [], [RecoveryInput("one", ink=ink)], 3)[0].ink for how in CORRUPTIONS["sketch"]
    }
    assert 4.0 < spoilt["thick lines"].sum() / ink.sum() < 5.5
    assert (spoilt["thick lines"] & ink).sum() == ink.sum()
    assert not (spoilt["broken lines"] & ~ink).any()
    assert 0.4 < spoilt["broken lines"].sum() / ink.sum() < 0.9
    assert 0.7 < spoilt["wobbly lines"].sum() / ink.sum() <= 1.0
    assert (spoilt["wobbly lines"] & ink).sum() < 0.5 * ink.sum()


def test_equal_seeds_spoil_equally() -> None:
    given = [RecoveryInput("one", cloud(350)), RecoveryInput("two", cloud(400))]
    for how in ways_to_spoil("points"):
        first, second, other = (spoilt_inputs(model(), how, [], given, seed) for seed in (1, 1, 2))
        for one, again, differs in zip(first, second, other, strict=True):
            assert np.array_equal(one.points, again.points)
            assert not np.array_equal(one.points, differs.points)


def test_tables_have_a_row_for_each_way(tmp_path: Path) -> None:
    trained = model()
    shape = next(random_shapes(STOOL, TEST_INTERVAL, np.random.default_rng(0)))
    spoilt = spoilt_inputs(trained, "half missing", [shape], [RecoveryInput("one", cloud())], 0)
    way = methods(trained, 10, 0)["network"]
    table = spoilt_table([tried("stool, half missing: network", STOOL, way, [shape], spoilt)])
    assert table.rows[0][0] == "stool, half missing: network"
    assert table.rows[0][1] == 1
    assert table.rows[0][2] > 0
    np.save(tmp_path / "strange.npy", cloud() @ np.diag([2.0, 1.0, 1.0]))
    strangers = foreign_inputs(tmp_path, "points")
    assert not foreign_inputs(tmp_path, "sketch")
    rows = foreign_rows(trained, strangers, 40, 0)
    found = foreign_table([(way, distances, results) for way, distances, results in rows])
    assert [row[0] for row in found.rows] == ["base shape", "network", "network, refined"]
    assert found.rows[2][2] < found.rows[0][2]


def test_a_foreign_file_that_cannot_be_read_is_told(tmp_path: Path) -> None:
    np.save(tmp_path / "one.npy", np.zeros((1, 3)))
    with pytest.raises(ConfigError, match="has 1 point"):
        foreign_inputs(tmp_path, "points")


def test_foreign_shapes_are_parts_of_their_own_and_may_stand_alone(tmp_path: Path) -> None:
    folder = tmp_path / "scans"
    folder.mkdir()
    np.save(folder / "one.npy", cloud(400))
    subject = load_dataset_run(CHAIRS, tmp_path)

    def named(spoilt: int, foreign: list[Path]) -> list[str]:
        return [each.name for each in _parts(subject, Namespace(programs=["chair"], spoilt=spoilt, foreign=foreign))]

    assert named(0, [folder]) == ["chair, points, from scans"]
    assert named(2, []) == [f"chair, {kind}, {how}" for kind in ("points", "sketch") for how in ways_to_spoil(kind)]
    assert len(set(named(2, [folder]))) == 11
