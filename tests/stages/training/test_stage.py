"""Training in the real pipeline: rounds, a kill, an edit, and published models."""

from __future__ import annotations

import csv
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from safetensors import safe_open

from pipeline.inventory import Inventory
from pipeline.paths import DatasetPaths
from stages.training.model_folder import MODEL_FILES
from tests.pipeline.conftest import made
from tests.stages.training.toy_training import STAGES, config, train

pytestmark = pytest.mark.slow

WORK = Path(".work/toys/training")
TRAIN_THERE = """
import sys
from pathlib import Path
from tests.stages.training.toy_training import config, train
train(config(), Path(sys.argv[1]))
"""


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The output folder of a run with one worker."""
    folder = tmp_path_factory.mktemp("training")
    assert train(config(), folder).made == 6
    return folder


def weights(out: Path) -> dict[str, bytes]:
    return {str(path.relative_to(out)): path.read_bytes() for path in sorted(out.rglob("*.safetensors"))}


def test_model_is_published_with_curves_and_card(out: Path) -> None:
    folder = out / "toys-models/tiny-toy-0"
    assert {path.name for path in folder.iterdir()} == MODEL_FILES
    rows = list(csv.DictReader((folder / "curves.csv").read_text(encoding="utf-8").splitlines()))
    assert [int(row["step"]) for row in rows] == [4, 8, 12, 16]
    card = (folder / "README.md").read_text(encoding="utf-8")
    assert "license: cc0-1.0" in card
    assert "dataset toys 1.0.0" in card
    best = min(rows, key=lambda row: float(row["val_loss"]))
    assert f"after {best['step']} steps" in card
    assert (folder / "curves.png").read_bytes().startswith(b"\x89PNG")


def test_published_weights_are_those_of_the_best_round(out: Path) -> None:
    rows = list(csv.DictReader((out / "toys-models/tiny-toy-0/curves.csv").read_text(encoding="utf-8").splitlines()))
    best = min(range(len(rows)), key=lambda number: float(rows[number]["val_loss"]))
    with (
        safe_open(out / "toys-models/tiny-toy-0/weights.safetensors", "np") as published,
        safe_open(out / WORK / f"tiny-toy-0-r{best:04}.safetensors", "np") as kept,
    ):
        names = set(published.keys())
        assert {f"weights.{name}" for name in names} == {name for name in kept.keys() if name.startswith("weights.")}  # noqa: SIM118
        assert all((published.get_tensor(name) == kept.get_tensor(f"weights.{name}")).all() for name in names)


def test_validation_loss_falls(out: Path) -> None:
    rows = list(csv.DictReader((out / "toys-models/tiny-toy-0/curves.csv").read_text(encoding="utf-8").splitlines()))
    assert float(rows[-1]["val_nats"]) < float(rows[0]["val_nats"])


def test_second_run_trains_nothing(out: Path) -> None:
    times = {path: path.stat().st_mtime_ns for path in (out / WORK / "records").iterdir()}
    assert train(config(), out).made == 0
    assert times == {path: path.stat().st_mtime_ns for path in (out / WORK / "records").iterdir()}


def test_killed_training_ends_with_the_same_weights(out: Path, tmp_path: Path) -> None:
    run = subprocess.Popen(
        [sys.executable, "-c", TRAIN_THERE, str(tmp_path)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    first = tmp_path / WORK / "records/tiny-toy-0-r0001.json"
    deadline = time.monotonic() + 120
    while not first.exists() and run.poll() is None and time.monotonic() < deadline:
        time.sleep(0.01)
    os.killpg(run.pid, signal.SIGKILL)
    run.wait()
    assert first.exists()
    assert not (tmp_path / "toys-models").exists(), "killed before its end"
    assert 1 <= train(config(), tmp_path, workers=2).made <= 3
    assert weights(tmp_path) == weights(out)
    assert made(tmp_path / "toys-models") == made(out / "toys-models")


def test_edit_of_one_model_does_not_retrain_others(tmp_path: Path) -> None:
    both = config({"max_rounds": 1}, {"name": "other", "max_rounds": 1})
    assert train(both, tmp_path, only="tiny").made == 3
    assert [path.name for path in (tmp_path / "toys-models").iterdir()] == ["tiny-toy-0"]
    assert train(both, tmp_path, workers=2).made == 2
    edited = config({"max_rounds": 1}, {"name": "other", "max_rounds": 1, "latent": 5})
    assert train(edited, tmp_path).made == 2
    more = config({"max_rounds": 1, "seeds": 2}, {"name": "other", "max_rounds": 1, "latent": 5})
    assert train(more, tmp_path).made == 2
    one, other = (tmp_path / f"toys-models/tiny-toy-{seed}/weights.safetensors" for seed in (0, 1))
    assert one.read_bytes() != other.read_bytes()


def test_training_ends_when_patience_is_exhausted(tmp_path: Path) -> None:
    # So large a rate makes it worse at once.
    wanted = config({"max_rounds": 9, "patience": 1, "learning_rate": 0.9, "steps": 3})
    result = train(wanted, tmp_path)
    assert not result.failed
    inventory = Inventory(wanted, STAGES, DatasetPaths(tmp_path, "toys")).stage("training")
    losses = [
        inventory.records[shard.name].summary["loss"] for shard in inventory.shards if shard.params["job"] == "round"
    ]
    best = losses.index(min(losses))
    assert len(losses) < 9
    assert len(losses) == best + 2
    assert inventory.missing == []
