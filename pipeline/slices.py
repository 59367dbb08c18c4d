"""Parts of a plan, and the locks that keep runs from working on the same part at once."""

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
    """Part `index` of `count` of every plan, from 1: what one job of a job array makes."""

    index: int = 1
    count: int = 1

    def __contains__(self, position: object) -> bool:
        return isinstance(position, int) and position % self.count == self.index - 1


WHOLE = Slice()


@contextmanager
def locked(own: StagePaths, part: Slice, waits: bool) -> Iterator[BinaryIO]:
    """One run at a time: a whole run excludes every other, a slice the same slice and whole runs.

    `waits` for the other run to end; else raises ConfigError while there is one.
    """
    with open(own.engine / "lock", "ab") as whole, open(own.engine / f"lock-{part.index}-{part.count}", "ab") as slot:
        at_once = 0 if waits else fcntl.LOCK_NB
        try:
            fcntl.flock(whole, at_once | (fcntl.LOCK_EX if part.count == 1 else fcntl.LOCK_SH))
            fcntl.flock(slot, at_once | fcntl.LOCK_EX)
        except BlockingIOError as error:
            raise ConfigError(f"another run is at work in {own.root}: wait for it, or end it") from error
        yield whole
