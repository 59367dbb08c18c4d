"""Where chaos happens: a small dataset, what an undisturbed run made of it, and runs that can be struck."""

from __future__ import annotations

import hashlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from pipeline.places import remove
from pipeline.records import read_record
from pipeline.shards import json_bytes

__all__ = ["Arena", "Run", "alive", "seconds_of"]

ROOT = Path(__file__).resolve().parents[2]

_HUNG_AFTER = 3600.0
"""Seconds after which a run is taken to hang; where nothing is compiled yet, the first one takes long."""

_DIFFERS = {"seconds", "peak_bytes"}


@dataclass
class Arena:
    """A dataset in `folder` whose `stages` are run in order, from the config that `sections` say, with two workers.

    `calm`: path below `out` and digest of every file of an undisturbed run; `busy`: seconds that a run's workers live.
    """

    folder: Path
    name: str
    stages: Sequence[str]
    sections: Mapping[str, Any]
    calm: dict[str, str] = field(default_factory=dict)
    busy: float = 10.0

    @property
    def out(self) -> Path:
        return self.folder / "out"

    @property
    def work(self) -> Path:
        return self.out / ".work" / self.name

    @property
    def config(self) -> Path:
        return self.folder / f"{self.name}.yaml"

    def write_config(self, **edited: Any) -> None:
        """Write the config, with other values for some sections."""
        facts = {"name": self.name, "seed": 3, "license": "MIT"}
        sections = {key: {**self.sections.get(key, {}), **edited.get(key, {})} for key in {**self.sections, **edited}}
        self.config.write_text(yaml.safe_dump({**facts, **sections}))

    def settle(self) -> None:
        """Make the dataset undisturbed, and note what came of it. Raises AssertionError where it cannot be made."""
        self.folder.mkdir(parents=True, exist_ok=True)
        self.write_config()
        run = self.start(self.stages)
        assert run.end() == 0, run.said()
        self.calm = self.digests()

    def start(self, stages: Sequence[str], *options: str, prepare: Callable[[], None] | None = None) -> Run:
        """Start `make dataset` from the first of `stages` on; `prepare` runs in the process before it begins."""
        command = [sys.executable, "-m", "tests.chaos.driver", ",".join(stages), "--config", str(self.config)]

        def begin() -> None:
            # who runs this in the background has it ignore Ctrl-C, and a child inherits that
            signal.signal(signal.SIGINT, signal.SIG_DFL)
            if prepare is not None:
                prepare()

        said = self.folder / f"said-{time.monotonic_ns()}.txt"
        with open(said, "wb") as stream:
            process = subprocess.Popen(
                [*command, "--out", str(self.out), "--workers", "2", *options],
                cwd=ROOT,
                stdout=stream,
                stderr=stream,
                start_new_session=True,
                preexec_fn=begin,
            )
        return Run(process, said)

    def unmake(self, stage: str, shards: Sequence[str]) -> None:
        """Take away shards as if they had never been made: record first, then the files."""
        for shard in shards:
            path = self.work / stage / "records" / f"{shard}.json"
            record = read_record(path)
            path.unlink(missing_ok=True)
            for file in record.files if record else ():
                (self.work / stage / file).unlink(missing_ok=True)

    def shards(self, stage: str) -> list[str]:
        """The shards of a stage that have records."""
        return sorted(path.stem for path in (self.work / stage / "records").glob("*.json"))

    def begin_anew(self) -> None:
        """Take away everything that was made."""
        if self.out.exists():
            remove(self.out)

    def digests(self) -> dict[str, str]:
        """Every file that counts below `out`, and a digest of it: not logs and locks, nor the times in records."""
        found = {}
        for path in sorted(self.out.rglob("*")):
            log = path.suffix == ".txt" and path.parent == self.work
            if path.is_file() and not log and not path.name.startswith("lock"):
                found[str(path.relative_to(self.out))] = _digest(path)
        return found

    def half_written(self, spared: set[str]) -> list[str]:
        """Files under a final name that are not what the undisturbed run has put there; `spared` are not looked at."""
        passing = {"progress", "failed", "rejects"}
        return [
            path
            for path, digest in self.digests().items()
            if path not in spared
            and not Path(path).name.startswith(".")
            and Path(path).parent.name not in passing
            and self.calm.get(path) != digest
        ]


def _digest(path: Path) -> str:
    content = path.read_bytes()
    if path.parent.name == "records":
        record = read_record(path)
        if record is None:
            return "no record"
        content = json_bytes({key: value for key, value in vars(record).items() if key not in _DIFFERS})
    return hashlib.sha256(content).hexdigest()


@dataclass
class Run:
    """A run under way. `workers`: every worker process that it was seen to have."""

    process: subprocess.Popen[bytes]
    output: Path
    workers: set[int] = field(default_factory=set)
    began: float = field(default_factory=time.monotonic)
    at_work: float | None = None

    def look(self) -> set[int]:
        """The worker processes that it has now."""
        now = {pid for pid in _descendants(self.process.pid) if b"LokyProcess" in _command(pid)}
        if now and self.at_work is None:
            self.at_work = time.monotonic()
        self.workers |= now
        return now

    def over(self) -> bool:
        return self.process.poll() is not None

    def wait(self, until: Callable[[], object]) -> bool:
        """Wait until something is so; False where the run ends before. Raises AssertionError for a run that hangs."""
        while not self.over():
            self.look()
            if until():
                return True
            assert time.monotonic() - self.began < _HUNG_AFTER, f"hangs: {self.said()[-2000:]}"
            time.sleep(0.05)
        return False

    def end(self) -> int:
        """The exit code, when it has come to its end. Raises AssertionError where it hangs or leaves workers behind."""
        try:
            self.wait(lambda: False)
            end = time.monotonic() + 20
            while any(alive(pid) for pid in self.workers) and time.monotonic() < end:
                time.sleep(0.05)
            left = [pid for pid in self.workers if alive(pid)]
            assert not left, f"workers {left} stay behind"
        finally:
            for pid in {self.process.pid, *self.workers}:
                if alive(pid):
                    os.kill(pid, signal.SIGKILL)
            self.process.wait()
        return self.process.returncode

    def said(self) -> str:
        return self.output.read_text(errors="replace")


def alive(pid: int) -> bool:
    """Whether there is such a process of Python, and no mere rest of one."""
    return b"python" in _command(pid)


def seconds_of(pid: int) -> float:
    """Processor time that a process has had."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    except OSError:
        return 0.0


def _command(pid: int) -> bytes:
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""


def _descendants(pid: int) -> Iterator[int]:
    """All processes that `pid` has started, whichever of its threads did, and theirs."""
    for path in Path(f"/proc/{pid}/task").glob("*/children"):
        try:
            children = path.read_text().split()
        except OSError:
            continue
        for child in map(int, children):
            yield child
            yield from _descendants(child)
