"""Output of a run: a progress bar for each stage, or a line now and then without a terminal, and a log file."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import NoReturn

from tqdm import tqdm

from pipeline.time_left import TimeLeft

_LINE_SECONDS = 20.0
"""Between two lines where there is no terminal."""

_COMPILATION_LINE_SECONDS = 5.0
"""Before the first line that says that kernels are compiled."""


def duration_text(seconds: float) -> str:
    """Return a duration for people: `8s`, `4m10s`, `2h05m`."""
    rounded = round(seconds)
    if rounded < 60:
        return f"{rounded}s"
    if rounded < 3600:
        return f"{rounded // 60}m{rounded % 60:02d}s"
    return f"{rounded // 3600}h{rounded % 3600 // 60:02d}m"


@dataclass(frozen=True)
class Progress:
    """Progress of a stage.

    planned: number of shards planned so far
    done: number of finished shards, plus the finished fractions of running ones
    failed: number of quarantined shards
    work: number of samples that planned shards will hold, by the plan, where known; else 0
    worked: number of those samples that are made, running shards included
    samples: number of samples in finished shards
    rejects: number of items that finished shards refused
    kernels: number of kernels that the workers have compiled; None while they compile nothing
    """

    planned: int
    done: float
    failed: int
    work: int
    worked: float
    samples: int
    rejects: int
    kernels: int | None = None


class EventLog:
    """Bar, lines and log of one stage's run."""

    def __init__(self, stage: str, log: Path) -> None:
        self._stage = stage
        self._log = log
        self._start = time.monotonic()
        self._last_line = self._start
        self._line_said_compiling = False
        self._left = TimeLeft()
        self._bar: tqdm[NoReturn] | None = None

    def say(self, text: str) -> None:
        """Write a line to the terminal and to the log."""
        self.note(text)
        text = f"{self._stage}: {text}"
        if self._bar is not None:
            self._bar.write(text, file=sys.stderr)
        else:
            print(text, file=sys.stderr, flush=True)

    def note(self, text: str) -> None:
        """Write lines to the log alone; a log that cannot be written stops nothing."""
        stamp = datetime.now().astimezone().isoformat(timespec="seconds")
        try:
            with open(self._log, "a", encoding="utf-8") as stream:
                stream.writelines(f"{stamp} {self._stage}: {line}\n" for line in text.splitlines())
        except OSError:
            pass

    def show(self, progress: Progress) -> None:
        """Show the progress: in the bar, or by a line now and then."""
        now = time.monotonic()
        left = self._left.after(progress.worked, progress.work, now)
        text = progress_text(progress, now - self._start, left)
        if sys.stderr.isatty():
            if self._bar is None:
                self._bar = tqdm(bar_format=self._stage, dynamic_ncols=True, leave=False)
            # Without a number of samples the number of shards grows, and a bar would run backwards.
            bar = "{percentage:3.0f}% |{bar:20}| " if progress.work else ""
            self._bar.bar_format = f"{self._stage:<14}{bar}{{desc}}"
            self._bar.total, self._bar.n = progress.work, progress.worked
            self._bar.set_description_str(text)
            return
        begins = progress.kernels is not None and not self._line_said_compiling
        if now - self._last_line >= (_COMPILATION_LINE_SECONDS if begins else _LINE_SECONDS):
            self._last_line = now
            self._line_said_compiling |= begins
            self.say(text)

    def close(self) -> None:
        """Remove the bar."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None


def progress_text(progress: Progress, seconds: float, left: float | None) -> str:
    """Describe a stage that has run for `seconds` and needs about `left` seconds more, where that is known."""
    if progress.work:
        items = [f"{int(progress.worked):,} of {progress.work:,} samples, {int(progress.done):,}"]
    else:
        items = [f"{progress.done:,.1f}"]
    items[0] += f" of {progress.planned:,} shards"
    if progress.samples and not progress.work:
        items.append(f"{progress.samples:,} samples")
    if progress.rejects:
        items.append(f"{progress.rejects:,} rejects")
    if progress.failed:
        items.append(f"{progress.failed} quarantined")
    if progress.kernels is not None:
        done = f" ({progress.kernels:,} done)" if progress.kernels else ""
        items.append(f"compiling kernels once on this machine{done}")
    items.append(f"{duration_text(seconds)} elapsed")
    if left is not None:
        items.append(f"about {duration_text(left)} left")
    return ", ".join(items)
