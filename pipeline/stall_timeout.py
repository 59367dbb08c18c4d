"""Patience: which of the running shards have shown no sign of work for too long.

A sign is what the shard tells of itself (`Task.progress`), or that a file which it writes has grown. That its process
lives, and is busy, is none: a loop without an end is busy, too.
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
"""Minutes. A shard is minutes of work at most; on a machine that is too busy, some that tell nothing take many."""

_Signs = tuple[str, tuple[tuple[str, int], ...]]


class StallWatch:
    """Watches the running shards of one stage; 0 minutes is patience without end."""

    def __init__(self, minutes: float, places: StagePaths) -> None:
        self.seconds = minutes * 60
        self._places = places
        self._every = min(max(self.seconds / 20, 0.5), 30.0)
        self._looked = time.monotonic()
        self._quiet: dict[str, tuple[_Signs, float]] = {}

    def lost_with(self, jobs: Iterable[Job]) -> list[Job]:
        """Those of the running `jobs` that have been without a sign for longer than patience lasts."""
        now = time.monotonic()
        # Time in which the mill itself was stopped is no time that its workers had.
        passed = min(now - self._looked, 3 * self._every)
        if not self.seconds or passed < self._every:
            return []
        self._looked = now
        running, written = list(jobs), self._written()
        quiet = {}
        for name in (job.shard.name for job in running):
            signs = self._told(name), tuple(written.get(name, ()))
            before, seconds = self._quiet.get(name, (None, 0.0))
            quiet[name] = signs, seconds + passed if signs == before else 0.0
        self._quiet = quiet
        return [job for job in running if quiet[job.shard.name][1] >= self.seconds]

    def begin_anew(self, shard: str) -> None:
        """A shard has ended: when it runs again, it has all its time again."""
        self._quiet.pop(shard, None)

    def _told(self, shard: str) -> str:
        try:
            return (self._places.progress / shard).read_text()
        except (OSError, ValueError):
            return ""

    def _written(self) -> dict[str, list[tuple[str, int]]]:
        """Name and size of each unfinished file, by shard; one look at the folder for all of them."""
        sizes: dict[str, list[tuple[str, int]]] = {}
        for folder in (self._places.root, self._places.rejects):
            for path in _unfinished(folder):
                try:
                    size = path.stat().st_size
                except OSError:
                    continue  # it was finished meanwhile
                sizes.setdefault(path.name[1:].partition(".")[0], []).append((path.name, size))
        return sizes


def _unfinished(folder: Path) -> list[Path]:
    try:
        names = os.listdir(folder)
    except OSError:
        return []
    return [folder / name for name in sorted(names) if name.startswith(".") and name.endswith(".tmp")]
