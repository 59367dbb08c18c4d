"""Shared by the tests of the engine: a config, and the bytes of everything that a run has made."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest
import yaml

WriteConfig = Callable[..., Path]

_DIFFERS_BY_NATURE = {"seconds", "peak_bytes", "checksum"}


@pytest.fixture
def write_config(tmp_path: Path) -> WriteConfig:
    """Writes `toys.yaml` with the given sections, and answers its path."""

    def write(**sections: Any) -> Path:
        path = tmp_path / "toys.yaml"
        flour = {"marks": str(tmp_path / "marks"), **sections.pop("flour", {})}
        path.write_text(yaml.safe_dump({"name": "toys", "seed": 3, **sections, "flour": flour}), encoding="utf-8")
        return path

    return write


def made(out: Path) -> Mapping[str, bytes]:
    """Path and bytes of every file below `out`, but for logs, locks, and the times and memory in records."""
    files: dict[str, bytes] = {}
    for path in sorted(out.rglob("*")):
        if not path.is_file() or (path.suffix == ".txt" and path.parent.parent.name == ".work"):
            continue
        if path.name.startswith("lock"):
            continue
        content = path.read_bytes()
        if path.parent.name == "records":
            record = json.loads(content)
            content = json.dumps({key: record[key] for key in record if key not in _DIFFERS_BY_NATURE}).encode()
        files[str(path.relative_to(out))] = content
    return files


def record_times(out: Path) -> Mapping[str, int]:
    """When each record below `out` was written, as `stage/shard`."""
    paths = (out / ".work" / "toys").glob("*/records/*.json")
    return {f"{path.parent.parent.name}/{path.stem}": path.stat().st_mtime_ns for path in paths}
