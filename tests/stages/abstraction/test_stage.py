"""The stage in the engine, with samples without a program; tests of collections check those with one."""

from __future__ import annotations

import json
import tarfile
from pathlib import Path
from typing import Any

import yaml

from tests.command import shapemill


def made(folder: Path, name: str, asked: dict[str, Any], stages: tuple[str, ...]) -> tuple[Path, Path]:
    sections = {
        "programs": {"program": "table", "mode": "random", "random": {"samples": 3}},
        "abstraction": asked,
    }
    config = folder / f"{name}.yaml"
    config.write_text(yaml.safe_dump({"name": name, "seed": 5, "license": "MIT", **sections}), encoding="utf-8")
    for stage in stages:
        code, printed = shapemill("run", stage, "--config", config, "--out", folder, "--workers", 1)
        assert code == 0, printed
    return config, folder / ".work" / name / "abstraction"


def members(root: Path) -> dict[str, bytes]:
    found = {}
    for path in sorted(root.glob("*.tar")):
        with tarfile.open(path) as archive:
            for item in archive:
                stream = archive.extractfile(item)
                assert stream is not None
                found[item.name] = stream.read()
    return found


def test_a_sample_without_a_program_says_why_and_stays(tmp_path: Path) -> None:
    gates = {"min_leaves": 1, "max_leaves": 1}
    found = members(made(tmp_path, "few", {"programs": True, "gates": gates}, ("programs", "abstraction"))[1])
    assert len(found) == 6
    assert all(content == b"" for name, content in found.items() if name.endswith(".txt"))
    reasons = {json.loads(content)["program"]["refused"] for name, content in found.items() if name.endswith(".json")}
    assert reasons == {"too many parts"}
    assert not members(made(tmp_path, "none", {}, ("programs", "abstraction"))[1])
