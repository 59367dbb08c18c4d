"""One shard of a published dataset is made from its manifest; `tests/test_dataset.py` does so for kits."""

from __future__ import annotations

import json
from pathlib import Path

import yaml

from tests.command import shapemill


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
