"""Output of a run: a progress bar for each stage, or a line now and then without a terminal, and a log file."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from pipeline.display import Display, duration_text
from pipeline.kernel_list import CompilationProgress
from pipeline.time_left import TimeLeft

_MAX_NAMES_SHOWN = 2


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
    running: shards that are being made
    """

    planned: int
    done: float
    failed: int
    work: int
    worked: float
    samples: int
    rejects: int
    kernels: int | None = None
    running: tuple[str, ...] = ()


class EventLog:
    """Display and log of one stage's run."""

    def __init__(self, stage: str, log: Path) -> None:
        self._stage = stage
        self._log = log
        self._display = _LoggedDisplay(stage, self.note)
        self._left = TimeLeft()
        self._compilation_left = TimeLeft()

    def say(self, text: str) -> None:
        """Write a line to the terminal and to the log."""
        self._display.say(text)

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
        left = self._left.after(progress.worked, progress.work, time.monotonic())
        # Without a number of samples the number of shards grows, and a bar would run backwards.
        self._display.show(progress_text(progress, self._display.elapsed, left), progress.worked, progress.work)

    def show_compilation(self, progress: CompilationProgress) -> None:
        """Show how far the compilation of kernels is, as `show` does."""
        left = self._compilation_left.after(progress.worked, progress.work, time.monotonic())
        text = f"compiling kernels, once on this machine: {progress.done:,} of {progress.total:,}"
        if not progress.total:
            text = "looking for compiled kernels"
        text += "" if left is None else f", about {duration_text(left)} left"
        self._display.show(text, progress.worked, progress.work)

    def close(self) -> None:
        """Remove the bar."""
        self._display.close()


class _LoggedDisplay(Display):
    """A display whose lines are written to the log, too."""

    def __init__(self, name: str, note: Callable[[str], None]) -> None:
        super().__init__(name)
        self._note = note

    def say(self, text: str) -> None:
        self._note(text)
        super().say(text)


def progress_text(progress: Progress, seconds: float, left: float | None) -> str:
    """Describe a stage that has run for `seconds` and needs about `left` seconds more, where that is known."""
    if progress.work:
        items = [f"{int(progress.worked):,} of {progress.work:,} samples, {int(progress.done):,}"]
    else:
        items = [f"{progress.done:,.1f}"]
    items[0] += f" of {progress.planned:,} shards"
    if progress.running and not progress.work:
        more = ", …" if len(progress.running) > _MAX_NAMES_SHOWN else ""
        items[0] += f" ({', '.join(progress.running[:_MAX_NAMES_SHOWN])}{more})"
    if progress.samples and not progress.work:
        items.append(f"{progress.samples:,} samples")
    if progress.rejects:
        items.append(f"{progress.rejects:,} rejects")
    if progress.failed:
        items.append(f"{progress.failed} quarantined")
    if progress.kernels is not None:
        done = f" ({progress.kernels:,} done)" if progress.kernels else ""
        items.append(f"compiling kernels, once on this machine{done}")
    items.append(f"{duration_text(seconds)} elapsed")
    if left is not None:
        items.append(f"about {duration_text(left)} left")
    return ", ".join(items)
