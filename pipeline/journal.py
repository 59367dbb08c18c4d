"""What people see of a run: one bar a stage with rate and time left, now and then a line where there is no
terminal, and a log file beside the records."""

from __future__ import annotations

import sys
import time
from datetime import datetime
from pathlib import Path
from typing import NoReturn

from tqdm import tqdm

__all__ = ["Journal", "span"]

_LINE_EVERY = 20.0
"""Seconds between two lines where there is no terminal."""


def span(seconds: float) -> str:
    """A length of time for people: `8s`, `4m10s`, `2h05m`."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole}s"
    if whole < 3600:
        return f"{whole // 60}m{whole % 60:02d}s"
    return f"{whole // 3600}h{whole % 3600 // 60:02d}m"


class Journal:
    """The bar, the lines and the log of one stage's run."""

    def __init__(self, stage: str, log: Path) -> None:
        self._stage = stage
        self._log = log
        self._start = time.monotonic()
        self._said = self._start
        self._first: float | None = None
        self._bar: tqdm[NoReturn] | None = None
        if sys.stderr.isatty():
            shape = "{desc} {percentage:3.0f}%|{bar}| {postfix}"
            self._bar = tqdm(desc=f"{stage:<11}", total=1.0, bar_format=shape, dynamic_ncols=True, leave=True)

    def say(self, text: str) -> None:
        """A line for people and for the log."""
        self.note(text)
        text = f"{self._stage}: {text}"
        if self._bar is not None:
            self._bar.write(text, file=sys.stderr)
        else:
            print(text, file=sys.stderr, flush=True)

    def note(self, text: str) -> None:
        """Lines for the log alone. A log that cannot be written stops nothing."""
        stamp = datetime.now().astimezone().isoformat(timespec="seconds")
        try:
            with open(self._log, "a", encoding="utf-8") as stream:
                stream.writelines(f"{stamp} {self._stage}: {line}\n" for line in text.splitlines())
        except OSError:
            pass

    def show(self, done: float, planned: int, samples: int, rejects: int, failed: int) -> None:
        """Move the bar: `done` of `planned` shards, where a running shard counts by how far it is."""
        now = time.monotonic()
        if self._first is None:
            self._first = done
        text = self._figures(done, planned, samples, rejects, failed, now - self._start)
        if self._bar is not None:
            self._bar.total, self._bar.n = max(planned, 1), done
            self._bar.set_postfix_str(text, refresh=True)
        elif now - self._said >= _LINE_EVERY:
            self._said = now
            self.say(text)

    def _figures(self, done: float, planned: int, samples: int, rejects: int, failed: int, seconds: float) -> str:
        figures = [f"{int(done)}/{planned} shards", f"{samples:,} samples", f"{span(seconds)} gone"]
        fresh = done - (self._first or 0.0)
        if fresh > 0 and seconds > 0:
            figures.append(f"{60 * fresh / seconds:.1f} shards/min")
            figures.append(f"{span((planned - done) * seconds / fresh)} left")
        if rejects:
            figures.append(f"{rejects:,} rejects")
        if failed:
            figures.append(f"{failed} set aside")
        return ", ".join(figures)

    def close(self) -> None:
        """Leave the bar as it stands."""
        if self._bar is not None:
            self._bar.close()
