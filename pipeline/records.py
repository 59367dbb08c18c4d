"""Records: what the mill knows of a finished shard. A shard is done when its record matches, and nothing else."""

from __future__ import annotations

import hashlib
import json
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

    fingerprint: of its recipe; inputs: `{stage/file: sha256}` of what it has read; files: `{file: {"sha256", "bytes"}}`
    of what it has written; rejects: refused items by reason; seconds: time that the shard took; peak_bytes: the largest
    memory that its worker had held until then; summary: the stage's own facts.
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
        """The record as one line of JSON, with a digest of itself: plans are made of what it says."""
        return json_bytes({**asdict(self), "seal": self.checksum()})

    def checksum(self) -> str:
        """A digest of all that it says."""
        return hashlib.sha256(json_bytes(json.loads(json_bytes(asdict(self))))).hexdigest()

    def bytes_on_disk(self) -> int:
        """Bytes of all its files."""
        return sum(int(each["bytes"]) for each in self.files.values())

    def is_whole(self, places: StagePaths) -> bool:
        """Whether all its files are there with the recorded size. Whoever reads one looks at its bytes (`Task.input`),
        and so does `make verify` at all."""
        paths = {places.root / name: each["bytes"] for name, each in self.files.items()}
        return all(path.is_file() and path.stat().st_size == size for path, size in paths.items())


def read_record(path: Path) -> ShardRecord | None:
    """The record in a file, or None if there is none, or none that this version of the mill wrote, or a damaged one."""
    written = read_json(path)
    try:
        seal = written.pop("seal")
        record = ShardRecord(**written)
        return record if record.checksum() == seal else None
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
    """All that a shard's bytes depend on, as a digest of each kind of thing: `code`, `config`, `dataset`, `plan`,
    `inputs`.

    `code` is the digest of the code that it reaches, `section` the stage's config as JSON, `dataset` name, version and
    seed, `inputs` the fingerprint of each record that the shard reads. What else the bytes depend on (the bytes of a
    mesh, the title on a card) the stage puts in the shard's `params`.
    """
    described = {
        "code": code,
        "config": section,
        "dataset": dataset,
        "plan": [stage, shard.name, dict(shard.params)],
        "inputs": dict(inputs),
    }
    return {kind: hashlib.sha256(json_bytes(value)).hexdigest() for kind, value in described.items()}


def fingerprint(recipe: Mapping[str, str]) -> str:
    """The sha256 over a recipe."""
    return hashlib.sha256(json_bytes(dict(recipe))).hexdigest()
