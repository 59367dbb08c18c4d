"""Paths of everything on disk, and atomic writing.

    OUT/.work/<dataset>/log.txt                    event log
    OUT/.work/<dataset>/workers.txt                output of workers and native libraries
    OUT/.work/<dataset>/verified.json              what the last verification found without faults
    OUT/.work/<dataset>/<stage>/<shard>.<...>      files of finished shards
    OUT/.work/<dataset>/<stage>/records/           one record for each finished shard
    OUT/.work/<dataset>/<stage>/rejects/           refused items, one JSON line each
    OUT/.work/<dataset>/<stage>/failed/            quarantined shards, with their tracebacks
    OUT/.work/<dataset>/<stage>/progress/          progress of running shards
    OUT/.work/<dataset>/<stage>/engine/            manifest.json (written last: all shards of the finished stage with
                                                   their fingerprints, and the digests of its code), published.json
                                                   (files that the stage has put into OUT), pruned.json (records whose
                                                   files were pruned), locks

A file whose name begins with a dot and ends in `.tmp` is being written; every other file is complete.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.errors import ConfigError, Fatal

_FATAL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EACCES, errno.EPERM}


@dataclass(frozen=True)
class StagePaths:
    """The folders of one stage."""

    root: Path

    @property
    def records(self) -> Path:
        return self.root / "records"

    @property
    def rejects(self) -> Path:
        return self.root / "rejects"

    @property
    def failed(self) -> Path:
        return self.root / "failed"

    @property
    def progress(self) -> Path:
        return self.root / "progress"

    def compilation_note(self, shard: str) -> Path:
        return self.progress / f"{shard}.kernels"

    @property
    def engine(self) -> Path:
        return self.root / "engine"

    @property
    def manifest(self) -> Path:
        return self.engine / "manifest.json"

    @property
    def published(self) -> Path:
        return self.engine / "published.json"

    @property
    def pruned(self) -> Path:
        return self.engine / "pruned.json"

    def make(self) -> None:
        """Make the folders. Raises Fatal where the disk refuses."""
        try:
            for folder in (self.records, self.rejects, self.failed, self.progress, self.engine):
                folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            remedy = "name a folder that you can write to with --out or OUT"
            raise Fatal(f"cannot make folders under {self.root}: {error.strerror}; {remedy}") from error


@dataclass(frozen=True)
class DatasetPaths:
    """The folders of one dataset under an output folder.

    shelf: folder of published files of other datasets; without, the output folder
    """

    out: Path
    dataset: str
    shelf: Path | None = None

    @property
    def work(self) -> Path:
        return self.out / ".work" / self.dataset

    @property
    def log(self) -> Path:
        return self.work / "log.txt"

    @property
    def worker_output(self) -> Path:
        return self.work / "workers.txt"

    def stage(self, name: str) -> StagePaths:
        return StagePaths(self.work / name)

    def published(self, file: str) -> Path:
        """Return the path of a published file, `<folder>/<file>` below the output folder; it need not exist.

        Raises ValueError for a name that leads out of the output folder.
        """
        if not file or any(step in ("", ".", "..") for step in file.split("/")) or file.startswith("."):
            raise ValueError(f"{file!r} is no file below the output folder")
        return (self.shelf or self.out) / file


def temporary_path(path: Path) -> Path:
    """Return where `path` is written before it is complete: in the same folder, so that the rename is atomic."""
    return path.with_name(f".{path.name}.tmp")


def remove(path: Path) -> None:
    """Delete a file or folder in a folder of the engine's own."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def sync_folder(folder: Path) -> None:
    """Flush renames in a folder to the disk."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def write_atomically(path: Path, content: bytes) -> None:
    """Write a small file completely or never, even if the power fails."""
    temporary = temporary_path(path)
    try:
        with open(temporary, "wb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(temporary, path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
    sync_folder(path.parent)


def read_json(path: Path) -> Any:
    """Return the JSON in a file of the engine's own; None where it is missing or corrupted.

    Raises PermissionError.
    """
    try:
        return json.loads(path.read_bytes())
    except PermissionError:
        raise
    except (OSError, ValueError, RecursionError):
        return None


def write_file(path: Path, content: bytes) -> Path:
    """Write a file that a command was asked for, and the folders above it; return its path.

    Raises ConfigError where that is impossible.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, content)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written there: {error.strerror}") from None
    return path


def file_digest(path: Path) -> str:
    """Return the sha256 of a file's bytes, in hex."""
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def fatal_cause(error: BaseException | None) -> OSError | None:
    """Return the error in the chain of causes that would fail every shard: disk full or no permission; else None."""
    while error is not None:
        if isinstance(error, OSError) and error.errno in _FATAL:
            return error
        error = error.__cause__ or error.__context__
    return None
