"""Training of recovery in the real pipeline."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from pipeline.config import Config
from pipeline.errors import ConfigError
from stages.training.stage import STAGE
from tests.pipeline.conftest import made
from tests.stages.training.recovery.toy import config, train

FOLDER = "stools-models/small-tests_stages_programs_stool-0"


@pytest.fixture(scope="module", params=["points", "sketch"])
def trained(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Config, Path]:
    """Return a config and the output folder of its training with one worker."""
    wanted, out = config(input=request.param), tmp_path_factory.mktemp(request.param)
    assert train(wanted, out).made == 6
    return wanted, out


@pytest.mark.slow
def test_model_of_a_program_is_published_deterministically(trained: tuple[Config, Path], tmp_path: Path) -> None:
    wanted, out = trained
    card = (out / FOLDER / "README.md").read_text(encoding="utf-8")
    assert "A `recovery` of program `tests.stages.programs.stool`" in card
    rows = list(csv.DictReader((out / FOLDER / "curves.csv").read_text(encoding="utf-8").splitlines()))
    assert [int(row["step"]) for row in rows] == [6, 12]
    assert train(wanted, tmp_path, workers=2).made == 6
    assert made(out / "stools-models") == made(tmp_path / "stools-models")


@pytest.mark.slow
def test_rounds_learn_from_their_shapes_and_earlier_ones(trained: tuple[Config, Path]) -> None:
    records = {
        path.stem: json.loads(path.read_text(encoding="utf-8"))
        for path in trained[1].glob(".work/stools/training/records/*.json")
    }
    name = "small-tests_stages_programs_stool-"
    inputs = [sorted(records[f"{name}0-r000{number}"]["inputs"]) for number in (0, 1)]
    first, second = [[name for name in of_round if "-pool" in name] for of_round in inputs]
    assert first == [f"training/{name}pool0000.safetensors"]
    assert second == [*first, f"training/{name}pool0001.safetensors"]


@pytest.mark.slow
def test_training_learns_a_stool(tmp_path: Path) -> None:
    wanted = config(
        learning_rate=0.01,
        points=128,
        widths=[16, 16],
        embedding=32,
        batch_size=16,
        steps=80,
        max_rounds=1,
        augmented_share=0,
        dropout=0,
    )
    train(wanted, tmp_path)
    rows = list(csv.DictReader((tmp_path / FOLDER / "curves.csv").read_text(encoding="utf-8").splitlines()))
    # a random choice is right in about a sixth
    assert float(rows[-1]["val_accuracy"]) > 0.3
    assert float(rows[-1]["val_chamfer"]) < 0.02


def test_unknown_program_is_reported_first() -> None:
    with pytest.raises(ConfigError, match="did you mean chair"):
        STAGE.check(config(programs=["chari"]))
    with pytest.raises(ConfigError, match="it learns from programs, but the config has no program"):
        STAGE.check(config(program=""))
