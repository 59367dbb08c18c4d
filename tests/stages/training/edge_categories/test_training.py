"""Training in the real pipeline: prepared samples and published models."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from pipeline.inventory import Inventory
from pipeline.paths import DatasetPaths
from pipeline.shards import bytes_array
from stages.training.edge_categories.batches import LabelledStrings
from stages.training.edge_categories.trained import load_edge_categories
from tests.stages.training.edge_categories.networks import STAGES, config, kit, network, space, train_networks, writer

pytestmark = pytest.mark.slow

WORK = Path(".work/nets/training")


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("networks")
    assert not train_networks(config(), folder).failed
    return folder


def made_ready(out: Path, split: str) -> LabelledStrings:
    name = out / WORK / f"toy-edge_categories.{split}"
    rows = np.fromfile(f"{name}.rows", dtype="<i2").reshape(-1, 4)
    return LabelledStrings(
        rows, bytes_array(Path(f"{name}.first.npy").read_bytes()), bytes_array(Path(f"{name}.graph.npy").read_bytes())
    )


def test_prepared_strings_have_the_categories_of_their_shapes(out: Path) -> None:
    described = json.loads((out / WORK / "toy-edge_categories.json").read_text(encoding="utf-8"))
    for split, seeds in (("train", range(12)), ("val", range(12, 18))):
        found = made_ready(out, split)
        assert described["counts"][split] == {"strings": len(found), "graphs": len(seeds), "tokens": len(found.rows)}
        assert found.first[-1] == len(found.rows)
        sizes = {seed: len(network(seed, 3 + (seed // 6))) for seed in seeds}
        parts = [int((found.row(number)[:, 0] <= 3).sum()) for number in range(len(found))]
        assert [sizes[seeds[shape]] for shape in found.graph.tolist()] == parts
    first = made_ready(out, "train").row(0)[:, 3]
    (canonical,) = writer().strings(writer().graph(network(0, 3)), 0, np.random.default_rng(0))
    assert first.tolist() == space().label(network(0, 3), [canonical], either_hand=True)[0].categories.tolist()


def test_model_is_published_and_read_with_its_kit(out: Path) -> None:
    folder = out / "nets-models/tiny-toy-0"
    rows = list(csv.DictReader((folder / "curves.csv").read_text(encoding="utf-8").splitlines()))
    assert [int(row["step"]) for row in rows] == [4, 8]
    assert {"val_accuracy", "val_tokens", "val_strings", "train_accuracy"} <= set(rows[0])
    model = load_edge_categories(folder / "weights.safetensors", kit())
    (chosen,) = model.choose(["ABA"], None)
    space().place("ABA", chosen)


def test_second_run_trains_nothing_and_changed_strings_are_prepared_again(out: Path) -> None:
    assert train_networks(config(), out).made == 0
    inventory = Inventory(config({"strings_per_shape": 2}), STAGES, DatasetPaths(out, "nets")).stage("training")
    assert "toy-edge_categories" not in inventory.records, "they are drawn by that number"
