"""The whole way, from shipped exemplars to the dataset folder: the same bytes however it was made."""

from __future__ import annotations

import csv
import hashlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml

from pipeline.compilation_note import RECORD_VARIABLE
from pipeline.kernel_list import KernelList
from stages.shape.graphs.canonical import graph_digest
from stages.shape.kit_files import load_kit
from stages.shape.sample import read_samples
from stages.strings.tokens import make_alphabet
from tests.command import shapemill
from tests.stages.strings.grammar_check import check_string
from tests.stated import stated

STAGES = ("exemplars", "variations", "validity", "strings", "points", "sketches", "package")

RECORD = "kernels.jsonl"

SHORT_OPTIONS = ("max_shapes=2", "dry_shapes=0", "probes=1", "radius=0.1", "graphs=1", "max_placements=1", "points=64")
"""Options of the tables that the report only has to contain."""

pytestmark = pytest.mark.slow


def write_config(folder: Path) -> Path:
    kits = [
        stated(
            {"name": name, "shapes": [str(shape) for shape in sorted(Path("datasets/exemplars", name).glob("*.glb"))]}
        )
        for name in ("castle", "playground")
    ]
    config = {
        "name": "small",
        "seed": 3,
        "license": "MIT",
        "exemplars": {"kits": kits},
        "variations": {"samples_per_kit": 24, "splits": {"shards": 2}},
        "points": {"uniform": 256},
        "sketches": {"size": 64, "renderer": "raster", "views": [{"name": "front"}]},
        "package": {"previewed": 4},
    }
    path = folder / "small.yaml"
    path.write_text(yaml.safe_dump(config), encoding="utf-8")
    return path


def make(config: Path, out: Path, workers: int) -> None:
    code, printed = shapemill("run", "--config", config, "--out", out, "--workers", workers)
    assert code == 0, printed


def kill_while_it_works(stage: str, config: Path, out: Path) -> bool:
    """Start a run, kill -9 it once a stage has committed something, and return whether it was still at work."""
    records = out / ".work" / "small" / stage / "records"
    command = [sys.executable, "-m", "pipeline", "run", "--config", str(config), "--out", str(out), "--workers", "1"]
    running = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    deadline = time.monotonic() + 120
    while running.poll() is None and time.monotonic() < deadline and not any(records.glob("*.json")):
        time.sleep(0.01)
    alive = running.poll() is None
    os.kill(running.pid, signal.SIGKILL)
    running.wait()
    return alive


def digests(out: Path) -> dict[str, str]:
    """sha256 of every published file."""
    return {
        str(path.relative_to(out)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(out.rglob("*"))
        if path.is_file() and ".work" not in path.parts
    }


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("dataset")
    config = write_config(folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(RECORD_VARIABLE, str(folder / RECORD))
        make(config, folder / "two", 2)
    return config, folder / "two"


def test_kernels_that_the_dataset_uses_are_listed(made: tuple[Path, Path]) -> None:
    lines = (made[1].with_name(RECORD)).read_text(encoding="utf-8").splitlines()
    used = {json.dumps(json.loads(line)["kernel"]) for line in lines}
    unlisted = used - {json.dumps([kernel.name, kernel.arguments]) for kernel in KernelList.read().kernels}
    assert len(used) > 40, "kernels that a cached kernel calls are not loaded"
    # Other kits may take other ways, but whatever the default dataset uses is compiled before its workers start.
    assert len(unlisted) <= 3, f"run `make kernels`: {sorted(unlisted)}"


def test_one_worker_killed_in_every_stage_makes_the_folder_of_two_workers(made: tuple[Path, Path]) -> None:
    config, two = made
    one = two.with_name("one")
    alive = [kill_while_it_works(stage, config, one) for stage in STAGES]
    make(config, one, 1)
    assert sum(alive) >= 6, "too many stages were over before the kill"
    assert digests(one) == digests(two)


def test_one_shard_is_reproduced_from_the_manifest(made: tuple[Path, Path]) -> None:
    published = made[1] / "small"
    code, printed = shapemill("reproduce", "val-000001", published, "--workers", 2)
    assert (code, printed.splitlines()[-1]) == (0, "val-000001: reproduced, with the same bytes as published"), printed
    assert "package: 1 of" in printed, "the other shards are not made"
    for name, models, words in (
        ("val-9", "datasets/exemplars", "has no shard val-9"),
        ("val-000001", "eval", "--models"),
    ):
        code, printed = shapemill("reproduce", name, published, "--models", models)
        assert code == 2
        assert words in printed


def test_every_table_about_kits_is_in_the_report(made: tuple[Path, Path], tmp_path: Path) -> None:
    config, out = made
    for name in ("small", ".work"):
        (tmp_path / name).symlink_to(out / name)
    asked = ["--config", str(config), "--out", str(tmp_path)]
    few = [f"--set={option}" for option in SHORT_OPTIONS]
    code, printed = shapemill("eval", "all", *asked, *few)
    assert code == 0, printed
    about_kits = {"compression", "corpora", "growth", "near_duplicates", "physical"}
    results = tmp_path / "small-eval"
    assert about_kits <= {path.stem for path in results.glob("*.csv")}
    header, *rows = csv.reader((results / "compression.csv").open(encoding="utf-8"))
    assert [row[:2] for row in rows] == [[kit, edges] for kit in ("castle", "playground") for edges in ("all", "tree")]
    assert all(row[header.index("exact %")] == "100.0" for row in rows)
    report = (results / "report.html").read_text(encoding="utf-8")
    assert all(f'<section id="{name}">' in report for name in about_kits)
    assert "made alone: make eval TABLE=worth" in report, "it takes longer than the others together"
    assert "say something else now" not in report, "the config is the one that the dataset was made with"


def test_verify_finds_nothing_wrong_and_then_a_flipped_byte(made: tuple[Path, Path]) -> None:
    config, out = made
    asked = ("verify", "--config", config, "--out", out, "--samples")
    code, printed = shapemill(*asked, 4)
    assert code == 0, printed
    shard = next((out / "small" / "data" / "val").glob("*.tar"))
    content = bytearray(shard.read_bytes())
    content[len(content) // 2] ^= 1
    shard.write_bytes(bytes(content))
    code, printed = shapemill(*asked, 1)
    content[len(content) // 2] ^= 1
    shard.write_bytes(bytes(content))
    assert code == 1
    assert shard.name in printed


def test_every_string_of_the_corpus_decodes_to_its_graph_and_obeys_the_grammar(made: tuple[Path, Path]) -> None:
    _, out = made
    work = out / ".work" / "small"
    graphs: dict[str, set[str]] = {}
    for shard in sorted((work / "variations").glob("small-*-0*.tar")):
        for sample in read_samples(shard):
            graphs.setdefault(f"{sample.kit}-{sample.split}", set()).add(sample.graph)
    seen = 0
    for text in sorted((out / "small-corpus").glob("*.txt")):
        kit_name = text.stem.rpartition("-")[0]
        exemplars = work / "exemplars"
        kit = load_kit(exemplars / f"{kit_name}.json", exemplars / f"{kit_name}.tar")
        alphabet = make_alphabet(kit.type_names())
        decoded = [check_string(line, alphabet, kit.grammar) for line in text.read_text(encoding="utf-8").splitlines()]
        assert {graph_digest(item.types, item.edges) for item in decoded} == graphs[text.stem]
        seen += len(decoded)
    statistics = json.loads((out / "small-corpus" / "statistics.json").read_text(encoding="utf-8"))
    assert seen > 300
    assert statistics
