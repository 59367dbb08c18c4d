"""The two recipes of CONTRIBUTING: a stage and a producer, each one folder, go the whole way with no change elsewhere.

`tests/example_project` is a project of its own: its folder `stages` is found by the PYTHONPATH alone.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest
import yaml

from pipeline.shards import bytes_array, read_shard

ROOT = Path(__file__).resolve().parents[1]
CONFIG = {
    "name": "heaps",
    "seed": 3,
    "license": "MIT",
    "pebbles": {"heaps": 2},
    "mass": {"density": 2.5},
    "points": {"uniform": 64},
    "sketches": {"size": 64, "renderer": "raster", "views": [{"name": "front"}]},
    "package": {"previewed": 4},
}
pytestmark = pytest.mark.slow

WHOLE_WAY = """
import sys
from pipeline.cli import command_line
from pipeline.registry import find_stages

config, out = sys.argv[1:]
print("stages:", *find_stages())
# Tables of our own are only to be in the report: two shapes and few points are enough.
few = [f"--set={option}" for option in ("dry_shapes=0", "max_shapes=2", "points=64", "emd_points=16")]
for arguments in (["run", "--workers", "1"], ["verify", "--samples", "6"], ["eval", "all", *few]):
    print("command:", arguments[0], flush=True)
    options = ["--config", config, "--out", out]
    code = command_line("stages", "eval")([*arguments, *options], obj="stages", standalone_mode=False)
    assert not code, code
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The folder that holds the dataset, its tables and its report, and what was printed before the tables."""
    folder = tmp_path_factory.mktemp("heaps")
    config = folder / "heaps.yaml"
    config.write_text(yaml.safe_dump(CONFIG), encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "tests" / "example_project")}
    command = [sys.executable, "-c", WHOLE_WAY, str(config), str(folder / "out")]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder / "out", done.stdout.partition("command: eval")[0]


def test_a_stage_comes_after_the_producers_and_before_package(made: tuple[Path, str]) -> None:
    order = next(line for line in made[1].splitlines() if line.startswith("stages:")).split()[1:]
    assert order.index("pebbles") < order.index("mass") < order.index("package")


def test_samples_of_a_new_producer_have_what_all_stages_add(made: tuple[Path, str]) -> None:
    samples = {k: m for path in sorted((made[0] / "heaps" / "data").rglob("*.tar")) for k, m in read_shard(path)}
    assert len(samples) == 3 * 2 * 2
    for members in samples.values():
        record = json.loads(members["json"])
        assert (record["producer"], record["language"]) == ("pebbles", "heap")
        heights = [float(word) for word in members["txt"].decode().split()]
        np.testing.assert_allclose(bytes_array(members["mass.npy"]), 2.5 * np.array(heights), rtol=1e-6)
        assert record["total_mass"] == pytest.approx(2.5 * sum(heights), abs=1e-3)
        assert {"glb", "points.npy", "labels.npy", "sketch0.png"} <= set(members)
        assert bytes_array(members["contacts.npy"]).shape == (2, record["counts"]["contacts"])
        assert record["lineage"]["parents"] == ["heap"]
        assert record["physics"]["rooted"]


def test_declarations_of_extensions_are_in_card_croissant_index_and_manifest(made: tuple[Path, str]) -> None:
    folder = made[0] / "heaps"
    card = (folder / "README.md").read_text(encoding="utf-8")
    for said in (
        "pebbles are thrown on a heap",
        "Every heap is thrown separately",
        "No pebble was harmed",
        "of pebbles",
    ):
        assert said in card
    assert "| `<key>.mass.npy` | float32 (parts) | Mass of each part. |" in card
    croissant = json.loads((folder / "croissant.json").read_text(encoding="utf-8"))
    assert "mass" in {item["name"] for item in croissant["recordSet"]}
    rows = pyarrow.parquet.read_table(made[0] / "heaps-index" / "heaps.parquet").to_pylist()
    assert all(row["total_mass"] > 0 for row in rows)
    assert "mass.npy" in {
        load["name"] for load in json.loads((folder / "manifest.json").read_text(encoding="utf-8"))["members"]
    }


def test_table_of_an_extension_is_found_and_in_the_report(made: tuple[Path, str]) -> None:
    results = made[0] / "heaps-eval"
    assert "highest" in (results / "heights.csv").read_text(encoding="utf-8")
    report = (results / "report.html").read_text(encoding="utf-8")
    for said in ("How high are the shapes?", "duplicates %", "Stability under a push", "data:image/png;base64"):
        assert said in report


def test_dataset_of_an_extension_is_verified(made: tuple[Path, str]) -> None:
    assert "geometry" in made[1]
    assert "faults" not in made[1]
