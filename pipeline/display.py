"""Progress on the screen: a bar on a terminal, elsewhere a line now and then."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NoReturn

from tqdm import tqdm

from pipeline.time_left import TimeLeft

FIRST_LINE_SECONDS = 5.0
"""Between two lines in the first minute."""

LINE_SECONDS = 20.0
"""Between two later lines: a run may take days."""

_FIRST_SECONDS = 60.0
_REFRESH_SECONDS = 0.5


def duration_text(seconds: float) -> str:
    """Return a duration for people: `8s`, `4m10s`, `2h05m`."""
    rounded = round(seconds)
    if rounded < 60:
        return f"{rounded}s"
    if rounded < 3600:
        return f"{rounded // 60}m{rounded % 60:02d}s"
    return f"{rounded // 3600}h{rounded % 3600 // 60:02d}m"


class Display:
    """Shows how far something is, on stderr, under the name of a stage or a command."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._start = time.monotonic()
        self._last_line = self._start
        self._bar: tqdm[NoReturn] | None = None

    @property
    def elapsed(self) -> float:
        """Seconds since the display was made."""
        return time.monotonic() - self._start

    def say(self, text: str) -> None:
        """Write a line that stays."""
        text = f"{self._name}: {text}"
        if self._bar is not None:
            self._bar.write(text, file=sys.stderr)
        else:
            print(text, file=sys.stderr, flush=True)

    def show(self, text: str, done: float = 0.0, total: float = 0.0) -> None:
        """Show the present state: `done` of `total`, where that is known."""
        now = time.monotonic()
        if sys.stderr.isatty():
            if self._bar is None:
                self._bar = tqdm(bar_format=self._name, dynamic_ncols=True, leave=False)
            bar = "{percentage:3.0f}% |{bar:20}| " if total else ""
            self._bar.bar_format = f"{self._name:<14}{bar}{{desc}}"
            self._bar.total, self._bar.n = total, done
            self._bar.set_description_str(text)
        elif now - self._last_line >= self._line_seconds(now):
            self._last_line = now
            self.say(text)

    def _line_seconds(self, now: float) -> float:
        return FIRST_LINE_SECONDS if now - self._start <= _FIRST_SECONDS else LINE_SECONDS

    def close(self) -> None:
        """Remove the bar."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None


@contextmanager
def ticking(name: str, text: str) -> Iterator[Callable[[str], None]]:
    """Show `text` and the time that has passed, while the block runs; yields a function that writes lines that stay."""
    with _refreshed(name, lambda _: (text, 0.0, 0.0)) as say:
        yield say


@contextmanager
def counting(name: str, total: int, unit: str) -> Iterator[Callable[[int], None]]:
    """Show how many of `total` units are done, while the block runs; yields a function that takes their number."""
    count = 0

    def set_count(done: int) -> None:
        nonlocal count
        count = done

    with watching(name, total, unit, lambda: count):
        yield set_count


@contextmanager
def watching(name: str, total: int, unit: str, done: Callable[[], int]) -> Iterator[None]:
    """Show how many of `total` units are done, which `done` is asked again and again, while the block runs."""
    left = TimeLeft()

    def state(seconds: float) -> tuple[str, float, float]:
        count = done()
        rest = left.after(count, total, seconds)
        more = "" if rest is None else f", about {duration_text(rest)} left"
        return f"{count:,} of {total:,} {unit}{more}", count, total

    with _refreshed(name, state):
        yield


@contextmanager
def _refreshed(name: str, state: Callable[[float], tuple[str, float, float]]) -> Iterator[Callable[[str], None]]:
    """Show text, done and total, as they are after some seconds, again and again while the block runs; yields a
    function that writes a line that stays.
    """
    display, ended = Display(name), threading.Event()

    def refresh() -> None:
        while not ended.wait(_REFRESH_SECONDS):
            text, done, total = state(display.elapsed)
            display.show(f"{text}, {duration_text(display.elapsed)} elapsed", done, total)

    thread = threading.Thread(target=refresh, daemon=True)
    thread.start()
    try:
        yield display.say
    finally:
        ended.set()
        thread.join()
        display.close()
