"""What is published of a dataset: its files and its index, each with its sha256."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from pipeline.errors import ConfigError
from pipeline.paths import file_digest
from stages.package.layout import CARD, CHECKSUMS, MANIFEST
from stages.package.locations import index_location
from stages.verification.verified import require_verification

LAST = (CARD, CHECKSUMS, MANIFEST)
"""Files that are sent after all others. Without the manifest a dataset does not open."""


@dataclass(frozen=True)
class PublishedFile:
    """One file.

    path: relative to the folder of the dataset, or of its index
    source: where it is on this machine
    size: in bytes
    """

    path: str
    source: Path
    sha256: str
    size: int

    def check(self) -> None:
        """Raise ConfigError where the bytes are not those that were verified."""
        if file_digest(self.source) != self.sha256:
            raise ConfigError(f"{self.source}: is corrupted: it has changed since it was verified; run `make dataset`")


@dataclass(frozen=True)
class Publication:
    """A dataset to publish.

    name, version: of the dataset
    files: of its folder, in the order in which they are sent
    index: its index
    """

    name: str
    version: str
    files: tuple[PublishedFile, ...]
    index: PublishedFile

    def outdated(self, stored: Iterable[str], destination: str) -> list[str]:
        """Return the shards of an older publication of the dataset, among the paths that are at a destination.

        Raises ConfigError for shards of another dataset.
        """
        kept = {file.path for file in self.files}
        return [path for path in shards_of(self.name, stored, destination) if path not in kept]


def shards_of(name: str, stored: Iterable[str], destination: str) -> list[str]:
    """Return the shards of a dataset among the paths that are at a destination.

    Raises ConfigError for shards of another dataset.
    """
    shards = [path for path in stored if path.startswith("data/")]
    for path in shards:
        if not re.fullmatch(rf"data/\w+/{re.escape(name)}-\w+-\w+-\d+\.tar", path):
            raise ConfigError(f"{destination} holds {path}, which is not of {name}: publish it elsewhere")
    return shards


def read_publication(folder: Path, verified: bool = True) -> Publication:
    """Return what is published of a dataset.

    verified: raise ConfigError unless it was verified without faults
    """
    if verified:
        require_verification(folder)
    manifest = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    lines = (folder / CHECKSUMS).read_text(encoding="utf-8").splitlines()
    digests = {path: digest for digest, _, path in (line.partition("  ") for line in lines)}
    digests[CHECKSUMS] = file_digest(folder / CHECKSUMS)
    ordered = [*(path for path in digests if path not in LAST), *LAST]
    index = Path(index_location(str(folder), manifest["index"]["path"]))
    try:
        return Publication(
            manifest["name"],
            manifest["version"],
            tuple(_published(path, folder / path, digests[path]) for path in ordered),
            _published(index.name, index, manifest["index"]["sha256"]),
        )
    except FileNotFoundError as error:
        raise ConfigError(f"{error.filename}: is missing since it was verified; run `make dataset`") from error


def _published(path: str, source: Path, sha256: str) -> PublishedFile:
    return PublishedFile(path, source, sha256, source.stat().st_size)
