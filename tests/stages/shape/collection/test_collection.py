"""Datasets of programs go the whole way, like those of kits; a config makes shapes in exactly one way."""

from __future__ import annotations

import io
import json
import subprocess
import sys
import tarfile
from pathlib import Path

import numpy as np
import pytest
import yaml

from pipeline.paths import DatasetPaths
from pipeline.shards import bytes_array
from stages.programs.language import LANGUAGE
from stages.shapeassembly import execute, parse
from stages.verification.samples import read_packaged, read_sample_record, sample_faults
from stages.verification.shard import shard_samples
from tests.command import shapemill
from tests.stated import stated

STAGES = (
    "exemplars",
    "variations",
    "programs",
    "shapeassembly",
    "abstraction",
    "validity",
    "strings",
    "points",
    "sketches",
    "package",
)
STOOLS = {
    "programs": {
        "program": "tests.stages.programs.stool",
        "all_values": {"train": 1, "val": 1, "test": 1},
        "splits": {"shards": 2},
    },
    "abstraction": {"programs": True},
    "points": {"uniform": 128},
    "sketches": {"size": 64, "renderer": "raster", "views": [{"name": "front"}]},
    "package": {"previewed": 2},
}
KITS = {"exemplars": {"kits": [stated({"name": "fort", "shapes": ["datasets/exemplars/playground/fort.glb"]})]}}

pytestmark = pytest.mark.slow


def config_of(folder: Path, sections: dict[str, object]) -> tuple[str, ...]:
    path = folder / "toy.yaml"
    path.write_text(yaml.safe_dump({"name": "toy", "seed": 5, "license": "MIT", **sections}), encoding="utf-8")
    return "--config", str(path), "--out", str(folder / "out")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, tuple[str, ...]]:
    folder = tmp_path_factory.mktemp("stools")
    arguments = config_of(folder, STOOLS)
    for stage in STAGES:
        code, printed = shapemill("run", stage, *arguments)
        assert code == 0, printed
    return folder / "out", arguments


def samples_of(out: Path) -> dict[str, dict[str, bytes]]:
    paths = sorted((out / "toy" / "data").rglob("*.tar"))
    return {key: members for path in paths for key, _, members in shard_samples(path)}


def test_samples_of_a_program_have_the_members_and_fields_of_all_samples(made: tuple[Path, tuple[str, ...]]) -> None:
    samples = samples_of(made[0])
    manifest = json.loads((made[0] / "toy" / "manifest.json").read_text(encoding="utf-8"))
    assert len(samples) == manifest["samples"] == 3 * (8 + 8 + 2 + 6)
    for key, members in samples.items():
        record = json.loads(members["json"])
        assert (record["key"], record["producer"]) == (key, "programs")
        assert record["text"] == members["txt"].decode()
        assert set(json.loads(record["text"])) <= {"height", "scale x", "has_rail", "rail_height"}
        labels = bytes_array(members["labels.npy"])
        parts = np.array([part["class"] for part in record["parts"]])
        assert (parts[bytes_array(members["instances.npy"])] == labels).all()
        assert {part["label"] for part in record["parts"]} <= {"seat", "leg", "rail"}


def test_samples_of_a_program_have_programs_of_their_boxes(made: tuple[Path, tuple[str, ...]]) -> None:
    for members in samples_of(made[0]).values():
        record, program = json.loads(members["json"]), members["program.txt"].decode()
        assert record["program"]["refused"] == "not refused"
        assert record["program"]["f_score"] >= 75
        assert record["program"]["lines"] == sum("(" in line for line in program.splitlines())
        assert len(execute(parse(program))) == len(record["parts"])


def test_a_dataset_of_a_program_is_verified_and_has_no_corpus(made: tuple[Path, tuple[str, ...]]) -> None:
    code, printed = shapemill("verify", *made[1])
    assert code == 0, printed
    assert "geometry" in printed
    assert not (made[0] / "toy-corpus").exists()


def test_the_card_explains_every_parameter(made: tuple[Path, tuple[str, ...]]) -> None:
    card = (made[0] / "toy" / "README.md").read_text(encoding="utf-8")
    assert "Height of the seat." in card
    assert "A rail above the seat would hang in the air." in card


def test_verify_sees_a_surface_that_the_text_does_not_make(made: tuple[Path, tuple[str, ...]]) -> None:
    samples, rebuild = samples_of(made[0]), {"program": LANGUAGE.rebuild(DatasetPaths(made[0], "toy"))}
    manifest = json.loads((made[0] / "toy" / "manifest.json").read_text(encoding="utf-8"))
    key, members = next(iter(samples.items()))
    other = next(sample for sample in samples.values() if sample["txt"] != members["txt"])

    def faults(members: dict[str, bytes]) -> list[str]:
        record = read_sample_record(members["json"])
        return list(sample_faults(read_packaged(key, record, members, rebuild, manifest["config"], {})))

    assert faults(members) == []
    assert any("another surface in its glb" in fault for fault in faults({**members, "glb": other["glb"]}))
    assert faults({**members, "txt": other["txt"]}) == ["its txt and its json hold different texts"]


def test_records_index_card_and_table_say_the_same_of_physics(made: tuple[Path, tuple[str, ...]]) -> None:
    import pyarrow.parquet

    records = [json.loads(members["json"]) for members in samples_of(made[0]).values()]
    rows = pyarrow.parquet.read_table(made[0] / "toy-index" / "toy.parquet").to_pylist()
    stable = {record["key"]: record["physics"]["stable"] for record in records}
    assert {row["key"]: row["stable"] for row in rows} == stable
    share = 100 * sum(stable.values()) / len(stable)
    assert f"| {share:.1f}% |" in (made[0] / "toy" / "README.md").read_text(encoding="utf-8")
    command = [sys.executable, "-m", "pipeline", "eval", "physical", *made[1]]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    row = next(line for line in done.stdout.splitlines() if line.startswith("| tests.stages.programs.stool"))
    columns = [cell.strip() for cell in row.strip("|").split("|")]
    assert float(columns[4]) == pytest.approx(share, abs=0.1)
    assert {path.suffix for path in (made[0] / "toy-eval").iterdir()} == {".html", ".md", ".csv", ".tex"}


def test_a_row_of_the_index_finds_its_sample(made: tuple[Path, tuple[str, ...]]) -> None:
    import pyarrow.parquet

    row = pyarrow.parquet.read_table(made[0] / "toy-index" / "toy.parquet").to_pylist()[-1]
    with (made[0] / "toy" / row["shard"]).open("rb") as shard:
        shard.seek(row["offset"])
        tar = tarfile.open(fileobj=io.BytesIO(shard.read(row["bytes"])))
    assert {name.partition(".")[0] for name in tar.getnames()} == {row["key"]}


def test_a_config_that_makes_no_shapes_is_refused(tmp_path: Path) -> None:
    code, printed = shapemill("run", "exemplars", *config_of(tmp_path, {}))
    assert code == 2
    ways = (
        "programs.program",
        "shapeassembly.programs, hierarchies, sampled or random",
        "string_sampling.sources",
        "exemplars.kits",
    )
    assert "a dataset needs one of " in printed
    assert all(way in printed for way in ways)
    assert "this config has none" in printed


def test_a_config_that_makes_shapes_in_two_ways_is_refused(tmp_path: Path) -> None:
    code, printed = shapemill("run", "exemplars", *config_of(tmp_path, {**STOOLS, **KITS}))
    assert code == 2
    assert "this config has programs.program and exemplars.kits" in printed
