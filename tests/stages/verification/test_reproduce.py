"""One shard of a published dataset is made from its manifest; `tests/test_dataset.py` does so for kits."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.command import shapemill

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
