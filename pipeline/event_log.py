"""What people see of a run: one bar a stage with rate and time left, now and then a line where there is no
terminal, and a log file beside the records."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import NoReturn

from tqdm import tqdm

from pipeline.time_left import TimeLeft

_LINE_EVERY = 20.0
"""Seconds between two lines where there is no terminal."""


def duration_text(seconds: float) -> str:
    """A length of time for people: `8s`, `4m10s`, `2h05m`."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole}s"
    if whole < 3600:
        return f"{whole // 60}m{whole % 60:02d}s"
    return f"{whole // 3600}h{whole % 3600 // 60:02d}m"


@dataclass(frozen=True)
class Progress:
    """How far a stage is.

    planned: shards as far as they are known; done: those that are finished, running ones by how far they are; failed:
    those set aside. work: samples that finished and planned shards hold, where the plan says so; worked: those that are
    made, with those of running shards. samples: those of finished shards; rejects: items that these refused.
    """

    planned: int
    done: float
    failed: int
    work: int
    worked: float
    samples: int
    rejects: int


class EventLog:
    """The bar, the lines and the log of one stage's run. Nothing is shown of a stage that has nothing to do."""

    def __init__(self, stage: str, log: Path) -> None:
        self._stage = stage
        self._log = log
        self._start = time.monotonic()
        self._said = self._start
        self._left = TimeLeft()
        self._bar: tqdm[NoReturn] | None = None

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

    def show(self, standing: Progress) -> None:
        """Say how far the stage is: in the bar, or by a line now and then."""
        now = time.monotonic()
        left = self._left.after(standing.worked, standing.work, now)
        text = progress_text(standing, now - self._start, left)
        if sys.stderr.isatty():
            if self._bar is None:
                self._bar = tqdm(bar_format=self._stage, dynamic_ncols=True, leave=False)
            # How many shards there will be is known where samples are: elsewhere a bar would run backwards.
            bar = "{percentage:3.0f}% |{bar:20}| " if standing.work else ""
            self._bar.bar_format = f"{self._stage:<14}{bar}{{desc}}"
            self._bar.total, self._bar.n = standing.work, standing.worked
            self._bar.set_description_str(text)
        elif now - self._said >= _LINE_EVERY:
            self._said = now
            self.say(text)

    def close(self) -> None:
        """Take the bar away: what there is to say of the finished stage is said in lines."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None


def progress_text(standing: Progress, seconds: float, left: float | None) -> str:
    """What is told of a stage that has run for `seconds` and needs about `left` more, if that can be told."""
    if standing.work:
        told = [f"{int(standing.worked):,} of {standing.work:,} samples, {int(standing.done):,}"]
    else:
        told = [f"{standing.done:,.1f}"]
    told[0] += f" of {standing.planned:,} shards"
    if standing.samples and not standing.work:
        told.append(f"{standing.samples:,} samples")
    if standing.rejects:
        told.append(f"{standing.rejects:,} rejects")
    if standing.failed:
        told.append(f"{standing.failed} set aside")
    told.append(f"{duration_text(seconds)} gone")
    if left is not None:
        told.append(f"about {duration_text(left)} left")
    return ", ".join(told)
