"""The record of a verification without faults, which publishing asks for: `OUT/.work/<dataset>/verified.json`.

It holds the sha256 of `checksums.txt`, which names the bytes of all files of the dataset, and of its index.
"""

from __future__ import annotations

from pathlib import Path

from pipeline.errors import ConfigError
from pipeline.paths import DatasetPaths, file_digest, read_json, write_atomically
from pipeline.shards import json_bytes
from stages.package.layout import CHECKSUMS


def record_verification(folder: Path, has_faults: bool) -> None:
    """Write the record of a dataset whose verification found no fault; delete it where it found some.

    Raises OSError where the disk refuses.
    """
    record = _record(folder)
    if has_faults:
        record.unlink(missing_ok=True)
        return
    record.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(record, json_bytes({"checksums": file_digest(folder / CHECKSUMS)}))


def require_verification(folder: Path) -> None:
    """Raise ConfigError, with the remedy, unless a dataset was verified without faults as it is now."""
    record = read_json(_record(folder))
    listing = folder / CHECKSUMS
    if not listing.is_file():
        raise ConfigError(f"{folder} is no finished dataset: it has no {CHECKSUMS}; make it with `make dataset`")
    if not isinstance(record, dict) or record.get("checksums") != file_digest(listing):
        raise ConfigError(f"{folder} has not been verified without faults as it is now: run `make verify` first")


def _record(folder: Path) -> Path:
    return DatasetPaths(folder.parent, folder.name).work / "verified.json"
