"""Records of finished shards. A shard is done when its record matches its fingerprint."""

from __future__ import annotations

import hashlib
import json
import stat
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pipeline.paths import StagePaths, read_json
from pipeline.shards import json_bytes
from pipeline.stage import Shard


@dataclass(frozen=True)
class ShardRecord:
    """One finished shard.

    fingerprint: sha256 of its recipe
    recipe: digest of each kind of thing that its bytes depend on
    inputs: `{stage/file: sha256}` of the files that it read
    files: `{file: {"sha256", "bytes"}}` of the files that it wrote
    rejects: number of refused items by reason
    seconds: clock time that the shard took
    peak_bytes: largest memory that its worker held while making it
    summary: facts of the stage, as JSON
    """

    stage: str
    shard: str
    fingerprint: str
    recipe: Mapping[str, str]
    inputs: Mapping[str, str]
    files: Mapping[str, Mapping[str, Any]]
    samples: int
    rejects: Mapping[str, int]
    seconds: float
    peak_bytes: int
    summary: Mapping[str, Any]

    def to_bytes(self) -> bytes:
        """Return the record as one line of JSON with its checksum, since plans depend on it."""
        return json_bytes({**asdict(self), "checksum": self.checksum()})

    def checksum(self) -> str:
        """Return the sha256 of its JSON."""
        return hashlib.sha256(json_bytes(json.loads(json_bytes(asdict(self))))).hexdigest()

    def bytes_on_disk(self) -> int:
        """Return the total size of its files in bytes."""
        return sum(int(file["bytes"]) for file in self.files.values())

    def is_whole(self, paths: StagePaths) -> bool:
        """Whether all its files exist with the recorded size; `Task.input` and `make verify` check their bytes."""
        return all(_size_of_file(paths.root / name) == file["bytes"] for name, file in self.files.items())


def _size_of_file(path: Path) -> int | None:
    try:
        found = path.stat()
    except (OSError, ValueError):
        return None
    return found.st_size if stat.S_ISREG(found.st_mode) else None


def read_record(path: Path) -> ShardRecord | None:
    """Return the record in a file; None where it is missing, corrupted or of another version."""
    written = read_json(path)
    try:
        checksum = written.pop("checksum")
        return ShardRecord(**written) if hashlib.sha256(json_bytes(written)).hexdigest() == checksum else None
    except (ValueError, TypeError, KeyError, AttributeError):
        return None


def recipe(
    stage: str,
    shard: Shard,
    code: str,
    section: Mapping[str, Any],
    dataset: tuple[str, str, int],
    inputs: Mapping[str, str],
) -> dict[str, str]:
    """Return a digest of each kind of thing that a shard's bytes depend on.

    code: digest of the modules that the shard's code imports
    section: the stage's config section as JSON
    dataset: name, version and seed of the dataset
    inputs: fingerprint of each record that the shard reads

    Anything else (the bytes of a mesh, the title on a card) belongs into the shard's `params`.
    """
    parts = {
        "code": code,
        "config": section,
        "dataset": dataset,
        "plan": [stage, shard.name, dict(shard.params)],
        "inputs": dict(inputs),
    }
    return {kind: hashlib.sha256(json_bytes(value)).hexdigest() for kind, value in parts.items()}


def fingerprint(recipe: Mapping[str, str]) -> str:
    """Return the sha256 of a recipe."""
    return hashlib.sha256(json_bytes(dict(recipe))).hexdigest()
