"""Exemplars in other proportions through the whole pipeline, with any number of workers, to a verified dataset."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import yaml

from stages.package.reader import Dataset
from stages.shape.sample import Sample, read_samples
from tests.command import shapemill
from tests.stages.proportions.stools import MESHES, STOOL
from tests.stated import stated
from tests.toy_kits.chains_and_rings import box, pose, write_model

LOOSE = {"tolerance": 0.01, "kinds": ["point", "line", "face"]}
STAGES = ("autoconfig", "exemplars", "proportions")


def write_config(folder: Path, **section: object) -> Path:
    paths = [write_model(folder / f"stool{number}.glb", MESHES, STOOL) for number in range(2)]
    path = folder / "stools.yaml"
    config = {
        "name": "stools",
        "seed": 3,
        "license": "MIT",
        "exemplars": {"kits": [stated({"name": "stool", "shapes": paths})]},
        "variations": {"samples_per_kit": 0},
        "proportions": {"samples_per_kit": 9, "splits": {"val": 0.2, "test": 0.2, "shards": 2}, **section},
        "points": {"uniform": 64},
        "sketches": {"size": 32, "views": [{"name": "front", "azimuth": 0.0, "elevation": 10.0}]},
    }
    path.write_text(yaml.safe_dump(config), encoding="utf-8")
    return path


def run(config: Path, out: Path, *stages: str, workers: int = 1) -> str:
    printed = ""
    for stage in stages:
        code, said = shapemill("run", stage, "--config", config, "--out", out, "--workers", workers)
        assert code == 0, said
        printed += said
    return printed


def texts(made: list[Sample]) -> list[tuple[str, str]]:
    return [(sample.key, sample.text) for sample in made]


def samples(out: Path) -> list[Sample]:
    shards = sorted((out / ".work" / "stools" / "proportions").glob("stools-*-0*.tar"))
    return [sample for shard in shards for sample in read_samples(shard)]


@pytest.mark.slow
def test_rows_of_a_shelf_become_samples_that_verify(tmp_path: Path) -> None:
    config = write_shelf_config(tmp_path)
    said = run(config, tmp_path / "out", *STAGES)
    assert "shelf: 12 of 12 shapes of" in said
    found = samples(tmp_path / "out")
    assert all(json.loads(sample.text)["rows"] for sample in found)
    assert {sample.lineage["method"] for sample in found} == {"rows"}
    run(config, tmp_path / "out", "validity", "points", "sketches", "package")
    code, said = shapemill("verify", "--config", config, "--out", tmp_path / "out")
    assert code == 0, said
    records = [sample.record for sample in Dataset.open(tmp_path / "out" / "stools")]
    for record in records:
        boards = sum(part["name"].startswith("board") for part in record["parts"])
        assert (record["counts"]["pieces"], record["counts"]["contacts"]) == (1, 2 * boards)


def test_every_layout_is_one_shape_where_parts_keep_their_sizes(tmp_path: Path) -> None:
    config = write_shelf_config(tmp_path, size="grow", min_count=0.75, max_count=1.25)
    run(config, tmp_path / "out", *STAGES)
    changes = [json.loads(sample.text).get("rows") for sample in samples(tmp_path / "out")]
    assert len({json.dumps(rows) for rows in changes if rows}) == 4, "6, 7, 9 or 10 boards for 8"


def write_shelf_config(folder: Path, **rows: object) -> Path:
    """Boards between two sides, 9 mm from each: in contact by the kit's tolerance, not by `validity.touching`."""
    meshes = {"side": box(0.05, 3.6, 0.4), "board": box(0.882, 0.04, 0.4)}
    boards = [("board", pose(0.0, 0.2 + 0.4 * number, 0.0)) for number in range(8)]
    sides = [("side", pose(x, 1.8, 0.0)) for x in (-0.475, 0.475)]
    shape = write_model(folder / "shelf.glb", meshes, [*sides, *boards])
    path = folder / "stools.yaml"
    config = {
        "name": "stools",
        "seed": 3,
        "license": "MIT",
        "exemplars": {"kits": [stated({"name": "shelf", "shapes": [shape], "contact": LOOSE})]},
        "variations": {"samples_per_kit": 0, "rows": {"use": True, **rows}},
        "proportions": {
            "samples_per_kit": 12,
            "parallel_searches": 1,
            "splits": {"val": 0.2, "test": 0.2, "shards": 2},
        },
        "points": {"uniform": 64},
        "sketches": {"size": 96, "views": [{"name": "front", "azimuth": 0.0, "elevation": 10.0}]},
    }
    path.write_text(yaml.safe_dump(config), encoding="utf-8")
    return path


@pytest.mark.slow
def test_a_dataset_of_stools_goes_the_whole_way_and_is_the_same_with_two_workers(tmp_path: Path) -> None:
    config = write_config(tmp_path)
    said = run(config, tmp_path / "one", *STAGES)
    assert "stool: 9 of 9 shapes; rejected: none" in said
    found = samples(tmp_path / "one")
    assert len({sample.key for sample in found}) == len({sample.text for sample in found}) == 9
    assert {sample.split for sample in found} == {"train", "val", "test"}
    assert {json.loads(sample.text)["exemplar"] for sample in found} == {"stool0", "stool1"}, "exemplars take turns"
    run(config, tmp_path / "two", *STAGES, workers=2)
    assert texts(samples(tmp_path / "two")) == texts(found)
    run(config, tmp_path / "one", "validity", "abstraction", "strings", "points", "sketches", "package")
    code, said = shapemill("verify", "--config", config, "--out", tmp_path / "one")
    assert code == 0, said


def test_a_run_that_finds_too_few_says_what_would_help(tmp_path: Path) -> None:
    config = write_config(tmp_path, min_difference=0.4)
    code, said = shapemill("run", "autoconfig", "--config", config, "--out", tmp_path / "out", "--workers", 1)
    assert code == 0, said
    shapemill("run", "exemplars", "--config", config, "--out", tmp_path / "out", "--workers", 1)
    code, said = shapemill("run", "proportions", "--config", config, "--out", tmp_path / "out", "--workers", 1)
    assert code != 0
    assert "set proportions.log_std or proportions.min_difference smaller" in said


def test_no_proportions_without_exemplars(tmp_path: Path) -> None:
    path = tmp_path / "stools.yaml"
    path.write_text(
        yaml.safe_dump({"name": "stools", "seed": 1, "proportions": {"samples_per_kit": 3}}), encoding="utf-8"
    )
    code, said = shapemill("plan", "--config", path, "--out", tmp_path / "out")
    assert code == 2
    assert "exemplars.kits" in said
