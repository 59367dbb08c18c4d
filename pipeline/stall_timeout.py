"""Stall timeout: find running shards that have made no progress for too long.

Progress is a call of `Task.progress` with new numbers, or the growth of a file that the shard writes. A busy process
is no progress: an endless loop is busy, too.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.paths import StagePaths

if TYPE_CHECKING:
    from pipeline.task import Job

DEFAULT_STALL_MINUTES = 60.0
"""A shard is minutes of work; on a busy machine, one that reports nothing can take many."""

_Progress = tuple[str, tuple[tuple[str, int], ...]]


class StallWatch:
    """Watches the running shards of one stage; a timeout of 0 minutes never ends a shard."""

    def __init__(self, minutes: float, paths: StagePaths) -> None:
        self.seconds = minutes * 60
        self._paths = paths
        self._interval = min(max(self.seconds / 20, 0.5), 30.0)
        self._last_look = time.monotonic()
        self._stalled: dict[str, tuple[_Progress, float]] = {}

    def stalled(self, jobs: Iterable[Job]) -> list[Job]:
        """Return the running jobs that have made no progress for longer than the timeout."""
        now = time.monotonic()
        # Time in which this process itself was stopped does not count.
        passed = min(now - self._last_look, 3 * self._interval)
        if not self.seconds or passed < self._interval:
            return []
        self._last_look = now
        running, written = list(jobs), self._written()
        quiet = {}
        for name in (job.shard.name for job in running):
            progress = self._reported(name), tuple(written.get(name, ()))
            before, seconds = self._stalled.get(name, (None, 0.0))
            quiet[name] = progress, seconds + passed if progress == before else 0.0
        self._stalled = quiet
        return [job for job in running if quiet[job.shard.name][1] >= self.seconds]

    def restart(self, shard: str) -> None:
        """Give a shard its full time again: it has ended."""
        self._stalled.pop(shard, None)

    def _reported(self, shard: str) -> str:
        try:
            return (self._paths.progress / shard).read_text(encoding="utf-8")
        except (OSError, ValueError):
            return ""

    def _written(self) -> dict[str, list[tuple[str, int]]]:
        """Return name and size of each unfinished file, by shard."""
        sizes: dict[str, list[tuple[str, int]]] = {}
        for folder in (self._paths.root, self._paths.rejects):
            for path in _unfinished(folder):
                try:
                    size = path.stat().st_size
                except OSError:
                    continue  # finished in the meantime
                sizes.setdefault(path.name[1:].partition(".")[0], []).append((path.name, size))
        return sizes


def _unfinished(folder: Path) -> list[Path]:
    try:
        names = os.listdir(folder)
    except OSError:
        return []
    return [folder / name for name in sorted(names) if name.startswith(".") and name.endswith(".tmp")]
