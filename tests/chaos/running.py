"""Runs under faults: the driver's process, its workers, and a check that none stays behind."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

_HANG_SECONDS = 3600.0
"""After these a run hangs; the first one may compile kernels."""


@dataclass
class Run:
    """A run in progress; `workers` are all worker processes that were seen."""

    process: subprocess.Popen[bytes]
    output_file: Path
    workers: set[int] = field(default_factory=set)
    began: float = field(default_factory=time.monotonic)

    def look(self) -> set[int]:
        """Return its current worker processes."""
        now = {pid for pid in _descendants(self.process.pid) if b"LokyProcess" in _command(pid)}
        self.workers |= now
        return now

    def over(self) -> bool:
        return self.process.poll() is not None

    def wait(self, until: Callable[[], object]) -> bool:
        """Wait for a condition; return False where the run ends before. Raises AssertionError for a run that hangs."""
        while not self.over():
            self.look()
            if until():
                return True
            assert time.monotonic() - self.began < _HANG_SECONDS, f"hangs: {self.output()[-2000:]}"
            time.sleep(0.05)
        return False

    def end(self) -> int:
        """Wait for the exit code. Raises AssertionError where the run hangs or leaves workers behind."""
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

    def output(self) -> str:
        return self.output_file.read_text(encoding="utf-8", errors="replace")


def alive(pid: int) -> bool:
    """Whether a Python process exists and is no zombie."""
    return b"python" in _command(pid)


def seconds_of(pid: int) -> float:
    """Processor time that a process has had."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
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
            children = path.read_text(encoding="utf-8").split()
        except OSError:
            continue
        for child in map(int, children):
            yield child
            yield from _descendants(child)
