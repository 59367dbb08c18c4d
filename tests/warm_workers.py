"""Workers that stay, with imports and kernels, for the next run of this process: tests of stages start a few.

A start costs 3 to 9 seconds of imports, half a second for toy stages. Tests of how workers start and end start some of
their own.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from joblib.externals.loky import process_executor

import pipeline.workers
from pipeline.compilation_note import RECORD_VARIABLE
from pipeline.workers import Workers, _Worker

_waiting: list[_Worker] = []
"""Workers without a run."""

_MAX_GROWTH_BYTES = 2_000_000_000
"""A worker that has grown by more is replaced. loky's 300 MB are less than the libraries of all stages."""


class WarmWorkers(Workers):
    """Workers that a run takes over from the run before."""

    def __init__(self, count: int, output: Path) -> None:
        super().__init__(count, output)
        self._idle = [_waiting.pop() if _waiting else worker for worker in self._idle]
        for worker in self._idle:
            worker._output, worker._made = output, 0
            if worker._executor is not None and worker.submit(_take_over, output).exception() is not None:
                worker.stop(kill=True)  # it died since; another process replaces it

    def stop(self, kill: bool) -> None:
        """Keep idle workers; end those at work, or all if asked to kill them."""
        if not kill:
            _waiting.extend(self._idle)
            self._idle = []
        super().stop(kill)


def _take_over(output: Path) -> None:
    process_executor._MAX_MEMORY_LEAK_SIZE = _MAX_GROWTH_BYTES
    descriptor = os.open(output, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    os.dup2(descriptor, 1)
    os.dup2(descriptor, 2)
    os.close(descriptor)


@contextmanager
def warm_workers() -> Iterator[None]:
    """Within the context, runs of this process use warm workers, unless they record what workers load."""
    before = pipeline.workers.Workers
    if RECORD_VARIABLE not in os.environ:
        pipeline.workers.Workers = WarmWorkers  # type: ignore[misc]
    try:
        yield
    finally:
        pipeline.workers.Workers = before  # type: ignore[misc]
