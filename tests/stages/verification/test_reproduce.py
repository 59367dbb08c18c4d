"""One shard of a published dataset is made from its manifest; `tests/test_dataset.py` does so for kits."""

from __future__ import annotations

import hashlib
import json
import shutil
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.command import shapemill
from tests.stages.shapeassembly.extraction.test_shards import tables

PROGRAMS = Path("datasets/exemplars/programs")
CREDIT = {"author": "A", "license": "MIT"}
HUT = hashlib.sha256(b"hut").hexdigest()


def test_bytes_that_differ_and_what_may_be_why_are_said(tmp_path: Path) -> None:
    config = {
        "name": "vases",
        "seed": 1,
        "programs": {"program": "vase", "mode": "random", "random": {"samples": 6}},
        **dict.fromkeys(("points", "sketches", "strings"), False),
    }
    (tmp_path / "vases.yaml").write_text(yaml.safe_dump(config), encoding="utf-8")
    code, printed = shapemill("run", "--config", tmp_path / "vases.yaml", "--out", tmp_path, "--workers", 1)
    assert code == 0, printed
    published = tmp_path / "vases"
    code, printed = shapemill("reproduce", "train-000000", published, "--workers", 1)
    assert code == 0, printed
    manifest = json.loads((published / "manifest.json").read_bytes())
    manifest["software"]["libraries"]["numpy"] = "1.0"
    (tmp_path / "manifest.json").write_text(json.dumps({**manifest, "seed": 4}), encoding="utf-8")
    code, printed = shapemill("reproduce", "train-000000", tmp_path, "--workers", 1)
    assert code == 1
    assert "vases-1_0_0-train-000000.tar has other bytes now" in printed
    assert "it was made with numpy 1.0, and this is " in printed


def test_folders_of_programs_and_files_of_hierarchies_are_found_by_what_is_in_them(tmp_path: Path) -> None:
    published, here = tmp_path / "published", tmp_path / "here"
    for folder in (published, here):
        (folder / "chairs").mkdir(parents=True)
        for name in ("stool-tripod.txt", "bench-garden.txt"):
            shutil.copy(PROGRAMS / name, folder / "chairs" / name)
        (tables(folder / "tables") / "9.json").rename(folder / "table.json")
    config = {
        "name": "chairs",
        "shapeassembly": {
            "programs": [{"name": "chairs", "path": str(published / "chairs"), "credit": CREDIT}],
            "hierarchies": [
                {"name": name, "path": str(published / path), "kind": "structurenet", "credit": CREDIT}
                for name, path in (("tables", "tables"), ("one", "table.json"))
            ],
            "splits": {"val": 0, "test": 0, "shards": 1},
        },
        **dict.fromkeys(("points", "sketches", "strings"), False),
    }
    (tmp_path / "chairs.yaml").write_text(yaml.safe_dump(config), encoding="utf-8")
    code, printed = shapemill("run", "--config", tmp_path / "chairs.yaml", "--out", tmp_path / "out", "--workers", 1)
    assert code == 0, printed
    shutil.rmtree(published)
    command = ("reproduce", "train-000000", tmp_path / "out" / "chairs", "--workers", 1, "--models")
    code, printed = shapemill(*command, here)
    assert code == 0, printed
    (here / "chairs" / "stool-tripod.txt").unlink()
    code, printed = shapemill(*command, here)
    assert (code, "published/chairs, sha256 " in printed) == (2, True), printed


MANIFEST: dict[str, Any] = {
    "name": "huts",
    "version": "1.0.0",
    "seed": 1,
    "config": {},
    "software": {"shapemill": "0.1.0", "libraries": {}},
    "shards": [{"path": "data/train/huts-1_0_0-train-000000.tar", "split": "train", "sha256": "0"}],
    "origins": [],
}


@pytest.mark.parametrize(
    ("changed", "shard", "words"),
    [
        ({}, "000000", "has no shard 000000; it has train-000000"),
        ({"shards": [{"path": "a.tar"}]}, "train-000000", "is no manifest of a dataset"),
        ({"origins": [{"file": "hut/model.glb", "sha256": "0"}]}, "train-000000", "name its folder with --models"),
        (
            {"origins": [{"file": "hut/hut.glb", "sha256": sha} for sha in (HUT, "1")]},
            "train-000000",
            "two models of the dataset are called hut/hut.glb",
        ),
        ({"name": "../../huts"}, "train-000000", "config.yaml"),
    ],
    ids=["a number in two splits", "no manifest", "a missing model", "two models of one name", "a name with a folder"],
)
def test_manifests_that_are_not_to_be_trusted_are_refused(
    changed: dict[str, Any], shard: str, words: str, tmp_path: Path
) -> None:
    (tmp_path / "hut.glb").write_bytes(b"hut")
    (tmp_path / "manifest.json").write_text(json.dumps(MANIFEST | changed), encoding="utf-8")
    code, printed = shapemill("reproduce", shard, tmp_path, "--models", tmp_path)
    assert (code, words in printed) == (2, True), printed
    assert sorted(path.name for path in tmp_path.iterdir()) == ["hut.glb", "manifest.json"]
