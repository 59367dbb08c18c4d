"""Slices of a plan for job arrays, and the locks that keep two runs off the same slice."""

from __future__ import annotations

import fcntl
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import BinaryIO

from pipeline.errors import ConfigError
from pipeline.paths import StagePaths


@dataclass(frozen=True)
class Slice:
    """Part `index` of `count` of every plan, from 1: the shards of one job of a job array."""

    index: int = 1
    count: int = 1

    def __contains__(self, position: object) -> bool:
        return isinstance(position, int) and position % self.count == self.index - 1


WHOLE = Slice()


@contextmanager
def locked(own: StagePaths, part: Slice, wait: bool) -> Iterator[BinaryIO]:
    """Allow one run at a time: a whole run excludes every other, a slice the same slice and whole runs.

    wait: whether to wait for the other run; without, raises ConfigError while there is one
    """
    with open(own.engine / "lock", "ab") as whole, open(own.engine / f"lock-{part.index}-{part.count}", "ab") as slot:
        nonblocking = 0 if wait else fcntl.LOCK_NB
        try:
            fcntl.flock(whole, nonblocking | (fcntl.LOCK_EX if part.count == 1 else fcntl.LOCK_SH))
            fcntl.flock(slot, nonblocking | fcntl.LOCK_EX)
        except BlockingIOError as error:
            raise ConfigError(f"another run works in {own.root}: wait for it, or end it") from error
        yield whole
