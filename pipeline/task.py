"""One shard inside a worker: its inputs, randomness and files, and the commit of its record."""

from __future__ import annotations

import contextlib
import os
import resource
import time
import traceback
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO, Literal

import numpy as np

from pipeline.code import transitive_imports
from pipeline.compilation_note import RECORD_VARIABLE, compilation_noted_in
from pipeline.config import Config
from pipeline.errors import ConfigError, Fatal, Rejected, ShardFailed
from pipeline.package_groups import missing_group
from pipeline.paths import (
    DatasetPaths,
    StagePaths,
    fatal_cause,
    file_digest,
    remove,
    sync_folder,
    temporary_path,
    write_atomically,
)
from pipeline.randomness import decision_rng
from pipeline.records import ShardRecord, fingerprint, read_record
from pipeline.shards import json_bytes
from pipeline.stage import Outcome, Shard, Task

_records_kernels = False
_PROGRESS_SECONDS = 0.5
"""Between two notes of a shard's progress."""


@dataclass(frozen=True)
class Job:
    """What a worker needs to make one shard; small, because it is sent to another process.

    inputs: `{stage/file: sha256}` of all files of its input shards, from their records
    starts: modules at which the shard's code begins
    code: digests of the modules that these import, from the start of the run
    """

    stage: str
    run_shard: Callable[[Task], Outcome]
    shard: Shard
    config: Config
    paths: DatasetPaths
    recipe: Mapping[str, str]
    inputs: Mapping[str, str]
    starts: tuple[str, ...] = ()
    code: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Report:
    """How a shard ended.

    status: done, committed; failed, may be retried; refused, would fail again; fatal, nothing else may start;
        corrupted, a file of an input differs from its record
    corrupted: the corrupted input, as `stage/shard`
    cpu_seconds: CPU time of a shard that is done
    """

    shard: str
    status: Literal["done", "failed", "refused", "fatal", "corrupted"]
    message: str = ""
    trace: str = ""
    corrupted: str = ""
    cpu_seconds: float = field(default=0.0, compare=False)


def make_shard(job: Job) -> Report:
    """Make and commit one shard. Never raises: an exception becomes the status of the report."""
    _forget_peak_memory()
    _record_kernels()
    task, start = _ShardTask(job), time.process_time()
    try:
        with compilation_noted_in(job.paths.stage(job.stage).compilation_note(job.shard.name)):
            outcome = job.run_shard(task)
        _check_code(job)
        task.commit(outcome)
        return Report(job.shard.name, "done", cpu_seconds=time.process_time() - start)
    except BaseException as raised:
        task.withdraw()
        trace = traceback.format_exc()
        error = missing_group(raised) or raised
        if task.corruption is not None:
            return task.corruption
        culprit = fatal_cause(error)
        if culprit is not None:
            return Report(job.shard.name, "fatal", str(culprit), trace)
        if isinstance(error, Fatal):
            return Report(job.shard.name, "fatal", str(error), trace)
        if isinstance(error, ConfigError | Rejected):
            return Report(job.shard.name, "refused", str(error), trace)
        message = str(error) if isinstance(error, ShardFailed) else f"{type(error).__name__}: {error}"
        return Report(job.shard.name, "failed", message, trace)


def _record_kernels() -> None:
    """Record the kernels that this process uses, where `make kernels` asks for it."""
    global _records_kernels
    if not _records_kernels and RECORD_VARIABLE in os.environ:
        from pipeline.kernel_record import record_kernels

        record_kernels(Path(os.environ[RECORD_VARIABLE]))
        _records_kernels = True


def _forget_peak_memory() -> None:
    """Let the kernel measure this process's peak memory from now on; its earlier shards may have needed more."""
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5", encoding="utf-8")


def _peak_memory() -> int:
    """Return the peak memory of this process, in bytes, since it was last forgotten.

    `getrusage` is asked only where the kernel tells nothing else: it counts the memory of the process that forked this
    one, too.
    """
    with contextlib.suppress(OSError):
        for line in Path("/proc/self/status").read_text(encoding="utf-8").splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def _check_code(job: Job) -> None:
    """Raise Fatal where the code changed since the run began: workers import late."""
    now = transitive_imports(job.starts)
    edited = sorted(module for module, _ in set(now.items()) ^ set(job.code.items()))
    if edited:
        raise Fatal(f"the code of stage {job.stage} was edited during the run ({', '.join(dict.fromkeys(edited))})")


class _ShardTask:
    """The Task that `run_shard` receives."""

    def __init__(self, job: Job) -> None:
        self._job = job
        self._paths: StagePaths = job.paths.stage(job.stage)
        self._streams: dict[str, BinaryIO] = {}
        self._read: dict[str, str] = {}
        self._rejects: Counter[str] = Counter()
        self._reject_stream: BinaryIO | None = None
        self._start = time.perf_counter()
        self._noted = 0.0
        self.corruption: Report | None = None

    @property
    def shard(self) -> Shard:
        return self._job.shard

    @property
    def config(self) -> Config:
        return self._job.config

    def rng(self, *decision: str | int) -> np.random.Generator:
        return decision_rng(self.config.seed, self._job.stage, self.shard.name, *decision)

    def input(self, stage: str, file: str) -> Path:
        source, name = f"{stage}/{file.partition('.')[0]}", f"{stage}/{file}"
        path = self._job.paths.stage(stage).root / file
        if source not in self.shard.inputs:
            raise ShardFailed(f"{self._job.stage}/{self.shard.name} reads {file}, but {source} is not among its inputs")
        if name not in self._job.inputs:
            raise ShardFailed(f"{source} has no file {file}")
        if name not in self._read:
            self._check(path, name, source)
            self._read[name] = self._job.inputs[name]
        return path

    def published(self, file: str) -> Path:
        return self._job.paths.published(file)

    def _check(self, path: Path, name: str, source: str) -> None:
        """Raise ShardFailed, and keep the report, where an input differs from its record."""
        try:
            wrong = "its sha256 is not the one in its record" if file_digest(path) != self._job.inputs[name] else ""
        except (FileNotFoundError, IsADirectoryError):
            wrong = "the file is missing"
        if wrong:
            message = f"{name} is corrupted: {wrong}"
            self.corruption = Report(self.shard.name, "corrupted", message, corrupted=source)
            raise ShardFailed(message)

    def output(self, file: str) -> BinaryIO:
        if "/" in file or not file.startswith(f"{self.shard.name}."):
            raise ValueError(f"file {file!r} of shard {self.shard.name} must be named {self.shard.name}.<anything>")
        if file in self._streams:
            raise ValueError(f"file {file!r} is opened twice")
        self._streams[file] = open(temporary_path(self._paths.root / file), "wb")
        return self._streams[file]

    def reject(self, item: str, reason: str, detail: str = "", count: int = 1) -> None:
        if self._reject_stream is None:
            self._reject_stream = open(temporary_path(self._reject_path), "wb")
        refused = {"item": item, "reason": reason, "detail": detail, "count": count}
        self._reject_stream.write(json_bytes(refused))
        self._rejects[reason] += count

    def progress(self, done: int, total: int) -> None:
        now = time.perf_counter()
        if now - self._noted >= _PROGRESS_SECONDS:
            self._noted = now
            (self._paths.progress / self.shard.name).write_text(f"{done} {total}", encoding="utf-8")

    @property
    def _reject_path(self) -> Path:
        return self._paths.rejects / f"{self.shard.name}.jsonl"

    def commit(self, outcome: Outcome) -> None:
        """Write the files to disk under their names, then the record.

        Raises ShardFailed where an input was corrupted and the stage continued.
        """
        if self.corruption is not None:
            raise ShardFailed(self.corruption.message)
        record_path = self._paths.records / f"{self.shard.name}.json"
        old = read_record(record_path)
        files = {name: self._finish(stream, self._paths.root / name) for name, stream in self._streams.items()}
        if self._reject_stream is not None:
            self._finish(self._reject_stream, self._reject_path)
        record = ShardRecord(
            stage=self._job.stage,
            shard=self.shard.name,
            fingerprint=fingerprint(self._job.recipe),
            recipe=dict(self._job.recipe),
            inputs=self._read,
            files=files,
            samples=outcome.samples,
            rejects=dict(self._rejects),
            seconds=round(time.perf_counter() - self._start, 3),
            peak_bytes=_peak_memory(),
            summary=dict(outcome.summary),
        )
        content = record.to_bytes()
        # The old record is removed first: after a kill between two renames, the shard must not match it.
        if os.path.lexists(record_path):
            remove(record_path)
            sync_folder(self._paths.records)
        for name in files:
            if (self._paths.root / name).is_dir():
                remove(self._paths.root / name)
            os.replace(temporary_path(self._paths.root / name), self._paths.root / name)
        if self._reject_stream is not None:
            os.replace(temporary_path(self._reject_path), self._reject_path)
        else:
            remove(self._reject_path)
        for name in old.files if old else ():
            if name not in files:
                remove(self._paths.root / name)
        sync_folder(self._paths.root)
        write_atomically(record_path, content)
        self._delete_progress()

    def withdraw(self) -> None:
        """Delete what is not committed."""
        streams = {self._paths.root / name: stream for name, stream in self._streams.items()}
        if self._reject_stream is not None:
            streams[self._reject_path] = self._reject_stream
        for path, stream in streams.items():
            temporary_path(path).unlink(missing_ok=True)
            with contextlib.suppress(OSError):  # closing flushes, which fails again on a full disk
                stream.close()
        self._delete_progress()

    def _delete_progress(self) -> None:
        (self._paths.progress / self.shard.name).unlink(missing_ok=True)

    @staticmethod
    def _finish(stream: BinaryIO, path: Path) -> dict[str, str | int]:
        if not stream.closed:
            stream.close()
        temporary = temporary_path(path)
        with open(temporary, "rb+") as written:
            os.fsync(written.fileno())
        return {"sha256": file_digest(temporary), "bytes": temporary.stat().st_size}
