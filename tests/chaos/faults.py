"""Faults: processes that die or stop, full disks, lost permissions, corrupted files, edited configs."""

from __future__ import annotations

import ctypes
import os
import signal
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from pipeline.records import read_record
from tests.chaos.running import Run, seconds_of
from tests.chaos.sandbox import Sandbox

STALL_MINUTES = "0.3"
"""Stall timeout of the rounds in which a worker is stopped."""


@dataclass
class InjectedFault:
    """A fault that was injected.

    hit: whether there was anything to break
    corrupted: files below `out` that it has corrupted
    put_right: repairs the machine after the run
    other: exit code and output of another run that it has started
    """

    words: str
    hit: bool = True
    corrupted: set[str] = field(default_factory=set)
    put_right: Callable[[], None] = lambda: None
    other: tuple[int, str] | None = None


@dataclass(frozen=True)
class Fault:
    """A kind of fault.

    codes: exit codes that the run may have
    options: options of the run
    words: text that the run must print, by exit code
    edited: whether the run has an edited config
    needs_worker: whether to wait for a worker
    needs_disk: whether `out` must be on a small disk of its own
    """

    inject: Callable[[Sandbox, Run, np.random.Generator], InjectedFault]
    codes: frozenset[int]
    options: tuple[str, ...] = ()
    words: Mapping[int, str] = field(default_factory=lambda: {3: "stopped: "})
    edited: bool = False
    needs_worker: bool = False
    needs_disk: bool = False
    prepare: Callable[[], None] | None = None


_STARTED_CPU_SECONDS = 1.5
"""After these a worker dies with its run; before, RELIABILITY.md promises nothing."""


def _signal_worker(run: Run, rng: np.random.Generator, number: int, min_seconds: float = 0.0) -> InjectedFault:
    workers = sorted(pid for pid in run.look() if seconds_of(pid) >= min_seconds)
    if not workers:
        return InjectedFault("no worker there", hit=False)
    pid = workers[rng.integers(len(workers))]
    try:
        os.kill(pid, number)
    except ProcessLookupError:
        return InjectedFault("the worker was gone", hit=False)
    return InjectedFault(f"{signal.Signals(number).name} to a worker")


def kill_worker(_: Sandbox, run: Run, rng: np.random.Generator) -> InjectedFault:
    return _signal_worker(run, rng, signal.SIGKILL)


def stop_worker(_: Sandbox, run: Run, rng: np.random.Generator) -> InjectedFault:
    return _signal_worker(run, rng, signal.SIGSTOP)


def end_driver(_: Sandbox, run: Run, rng: np.random.Generator) -> InjectedFault:
    """End the driver, every second time after stopping a worker."""
    number = [signal.SIGKILL, signal.SIGTERM, signal.SIGINT][rng.integers(3)]
    words = _signal_worker(run, rng, signal.SIGSTOP, _STARTED_CPU_SECONDS).words + ", " if rng.random() < 0.5 else ""
    run.process.send_signal(number)
    return InjectedFault(f"{words}{signal.Signals(number).name} to the driver")


def fill_disk(sandbox: Sandbox, _: Run, rng: np.random.Generator) -> InjectedFault:
    junk = sandbox.folder / "junk"
    left = int(rng.integers(0, 60_000))
    with open(junk, "wb") as stream:
        try:
            while True:
                os.write(stream.fileno(), b"\0" * 65_536)
        except OSError:
            os.ftruncate(stream.fileno(), max(os.fstat(stream.fileno()).st_size - left, 0))
    return InjectedFault(f"disk filled but for {left // 1000} kB", put_right=lambda: junk.unlink(missing_ok=True))


def take_rights(sandbox: Sandbox, _: Run, rng: np.random.Generator) -> InjectedFault:
    folders = [sandbox.out, *(path for path in sandbox.out.rglob("*") if path.is_dir())]
    folder = sorted(folders)[rng.integers(len(folders))]
    folder.chmod(0o555)
    return InjectedFault(
        f"no right to write in {folder.relative_to(sandbox.folder)}", put_right=lambda: folder.chmod(0o755)
    )


def _obey_permissions() -> None:
    # Root writes everywhere; without CAP_DAC_OVERRIDE in its bounding set, what it executes does not.
    ctypes.CDLL(None).prctl(24, 1)


def corrupt_shard(sandbox: Sandbox, _: Run, rng: np.random.Generator) -> InjectedFault:
    """Flip a bit in a file of a finished shard."""
    files = []
    for noted in sorted(sandbox.written()):
        record = read_record(noted)
        paths = [noted.parents[1] / file for file in sorted(record.files)] if record else []
        files += [path for path in paths if path.is_file() and path.stat().st_size]
    if not files:
        return InjectedFault("no shard there", hit=False)
    path = files[rng.integers(len(files))]
    place = int(rng.integers(path.stat().st_size))
    with open(path, "r+b") as stream:
        stream.seek(place)
        byte = stream.read(1)[0] ^ (1 << int(rng.integers(8)))
        stream.seek(place)
        stream.write(bytes([byte]))
    linked = [item for item in sandbox.out.rglob("*") if item.is_file() and item.samefile(path)]
    return InjectedFault(
        f"a bit of {path.relative_to(sandbox.work)}", corrupted={str(item.relative_to(sandbox.out)) for item in linked}
    )


def cut_record(sandbox: Sandbox, _: Run, rng: np.random.Generator) -> InjectedFault:
    paths = sorted(sandbox.written())
    if not paths:
        return InjectedFault("no record there", hit=False)
    path = paths[rng.integers(len(paths))]
    size = int(rng.integers(path.stat().st_size))
    os.truncate(path, size)
    return InjectedFault(
        f"{path.relative_to(sandbox.work)} cut to {size} bytes", corrupted={str(path.relative_to(sandbox.out))}
    )


def edit_config(_: Sandbox, run: Run, rng: np.random.Generator) -> InjectedFault:
    """Kill a run with an edited config, or let it end."""
    if rng.random() < 0.5:
        run.process.kill()
    return InjectedFault("a run with an edited config, then back")


def second_run(sandbox: Sandbox, run: Run, _: np.random.Generator) -> InjectedFault:
    other = sandbox.start(sandbox.steps)
    return InjectedFault("a second run", other=(other.end(), other.output()))


FAULTS: dict[str, Fault] = {
    "kill a worker": Fault(kill_worker, frozenset({0}), needs_worker=True),
    "stop a worker": Fault(stop_worker, frozenset({0}), ("--stall-timeout", STALL_MINUTES), needs_worker=True),
    "end the driver": Fault(end_driver, frozenset({0, -9, -2, -15, 130, 143})),
    "fill the disk": Fault(fill_disk, frozenset({0, 2, 3}), needs_disk=True),
    "take rights": Fault(take_rights, frozenset({0, 3}), prepare=_obey_permissions),
    "corrupt a finished shard": Fault(corrupt_shard, frozenset({0})),
    # Exit code 2: cut after its own stage has checked it, before the stage that reads it begins.
    "cut a record": Fault(cut_record, frozenset({0, 2}), words={2: "shards are not made (the first is "}),
    "edit the config": Fault(edit_config, frozenset({0, -9}), edited=True),
    "a second run": Fault(second_run, frozenset({0, 2})),
}
