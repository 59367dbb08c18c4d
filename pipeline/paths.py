"""Where things lie on disk, and how a file gets there whole.

    OUT/.work/<dataset>/log.txt                    what the mill did, by the minute
    OUT/.work/<dataset>/workers.txt                what workers and native libraries printed
    OUT/.work/<dataset>/<stage>/<shard>.<...>      the files of finished shards
    OUT/.work/<dataset>/<stage>/records/           one record a finished shard
    OUT/.work/<dataset>/<stage>/rejects/           refused items, one JSON line each
    OUT/.work/<dataset>/<stage>/failed/            shards set aside, with their tracebacks
    OUT/.work/<dataset>/<stage>/progress/          how far running shards are
    OUT/.work/<dataset>/<stage>/mill/              manifest.json (written last: all shards of the finished stage with
                                                   their fingerprints, and the digests of its code), published.json
                                                   (the files that it has put in OUT itself), let-go.json (the
                                                   records whose files were taken away on purpose), locks

A file that begins with a dot and ends in `.tmp` is being written; every other file is whole.
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

    @property
    def engine(self) -> Path:
        return self.root / "mill"

    @property
    def manifest(self) -> Path:
        return self.engine / "manifest.json"

    @property
    def published(self) -> Path:
        return self.engine / "published.json"

    @property
    def pruned(self) -> Path:
        return self.engine / "let-go.json"

    def make(self) -> None:
        """Make the folders. Raises Fatal when the disk does not let us."""
        try:
            for folder in (self.records, self.rejects, self.failed, self.progress, self.engine):
                folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise Fatal(f"cannot make folders under {self.root}: {error.strerror}") from error


@dataclass(frozen=True)
class DatasetPaths:
    """The folders of one dataset under an output folder.

    shelf: where what other datasets have published is looked for, the output folder itself if not said.
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
        """Where a dataset publishes a file, `<folder>/<file>` below the output folder, whether it is there or not.

        Raises ValueError for a name that leads elsewhere.
        """
        if not file or any(step in ("", ".", "..") for step in file.split("/")) or file.startswith("."):
            raise ValueError(f"{file!r} is no file below the output folder")
        return (self.shelf or self.out) / file


def temporary_path(path: Path) -> Path:
    """Where `path` is written before it is whole: beside it, so that the rename is atomic."""
    return path.with_name(f".{path.name}.tmp")


def remove(path: Path) -> None:
    """Take away what stands at a place of the mill's own, whatever it is: nothing there belongs to anybody else."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def sync_folder(folder: Path) -> None:
    """Bring renames in `folder` to the disk."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def write_atomically(path: Path, content: bytes) -> None:
    """Write a small file so that it is there whole or not at all, after a power cut too."""
    beside = temporary_path(path)
    try:
        with open(beside, "wb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(beside, path)
    except BaseException:
        beside.unlink(missing_ok=True)
        raise
    sync_folder(path.parent)


def read_json(path: Path) -> Any:
    """The JSON in a file of the mill's own; None where there is none, or none any more: the disk has spoilt it.

    Raises PermissionError.
    """
    try:
        return json.loads(path.read_bytes())
    except PermissionError:
        raise
    except (OSError, ValueError, RecursionError):
        return None


def write_file(path: Path, content: bytes) -> Path:
    """Write a file that a command was asked for, whole, and the folders above it; `path`.

    Raises ConfigError where that cannot be.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, content)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written there: {error.strerror}") from None
    return path


def file_digest(path: Path) -> str:
    """The sha256 of a file's bytes, in hex."""
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def fatal_cause(error: BaseException | None) -> OSError | None:
    """The error in the chain of causes of `error` that no other shard would survive either: disk full, no right."""
    while error is not None:
        if isinstance(error, OSError) and error.errno in _FATAL:
            return error
        error = error.__cause__ or error.__context__
    return None
