"""Workers: each is a loky executor of one process, so that a death has one cause and harms no other shard.

One executor with many processes would break as a whole when one of them dies, without naming the shard. Native
libraries do kill their process (a segmentation fault, memory), so even a single worker is a process of its own. So it
is for workers of a cluster (`pipeline/cluster.py`) and jobs of a job array.
"""

from __future__ import annotations

import faulthandler
import os
import signal
import warnings
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from pathlib import Path
from typing import Any

from joblib.externals.loky.backend.utils import kill_process_tree
from joblib.externals.loky.process_executor import BrokenProcessPool, ProcessPoolExecutor, TerminatedWorkerError

from pipeline.shared_memory import semaphores_needed
from pipeline.task import Job, Report, make_shard
from pipeline.termination import die_with_parent

_SHARDS_PER_PROCESS = 64
"""A fresh process then takes over: native libraries leak."""

_EXIT_SECONDS = 10.0
"""After these, a worker that was asked to exit is killed."""


def _same_arithmetic() -> dict[str, str]:
    """Return settings under which OpenBLAS gives the same sums on every processor with AVX2.

    Its kernels differ by processor and cache size, and their sums in the last digits.
    """
    flags = Path("/proc/cpuinfo").read_text(encoding="utf-8").split() if Path("/proc/cpuinfo").is_file() else []
    return {"OPENBLAS_CORETYPE": "Haswell", "OPENBLAS_L2_SIZE": "512"} if {"avx2", "fma"} <= set(flags) else {}


_ENVIRONMENT = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "NUMEXPR_NUM_THREADS": "1",
    "NUMBA_NUM_THREADS": "1",
    "PYTHONHASHSEED": "0",
    **_same_arithmetic(),
}
"""Environment of every worker: one thread, and the same arithmetic on every machine."""

# loky replaces a process that has grown by 300 MB before its next job, and warns as if a job were lost.
warnings.filterwarnings("ignore", message="A worker stopped while some jobs were given to the executor")

# Processes of their own remove the semaphores of a killed run, and would warn of a leak in the terminal.
_NO_LEAKS = "ignore:resource_tracker:UserWarning"
_STATED = os.environ.get("PYTHONWARNINGS", "")
if _NO_LEAKS not in _STATED:  # workers of workers have it already
    os.environ["PYTHONWARNINGS"] = f"{_STATED},{_NO_LEAKS}" if _STATED else _NO_LEAKS


def _start_worker(parent: int, output: Path) -> None:
    """Prepare a worker: it dies with its parent, leaves Ctrl-C to it, and prints into a file of the dataset."""
    die_with_parent()
    if os.getppid() != parent:
        os._exit(1)  # the parent died before it could be watched
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        descriptor = os.open(output, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    except OSError:
        return  # the first shard that writes reports the full disk
    os.dup2(descriptor, 1)
    os.dup2(descriptor, 2)
    os.close(descriptor)
    faulthandler.enable()


class _Worker:
    def __init__(self, output: Path) -> None:
        self._output = output
        self._executor: ProcessPoolExecutor | None = None
        self._made = 0

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        if self._executor is not None and self._made >= _SHARDS_PER_PROCESS:
            self.stop(kill=False)
        if self._executor is None:
            self._made = 0
            with semaphores_needed():
                self._executor = ProcessPoolExecutor(
                    max_workers=1,
                    timeout=None,
                    initializer=_start_worker,
                    initargs=(os.getpid(), self._output),
                    env=_ENVIRONMENT,
                )
        self._made += 1
        future: Future[Any] = self._executor.submit(function, *arguments)
        return future

    def stop(self, kill: bool) -> None:
        """End the process: at once, or after its current job.

        A process that was stopped (SIGSTOP) does not exit by itself and is killed after _EXIT_SECONDS.
        """
        if self._executor is None:
            return
        executor, self._executor = self._executor, None
        processes, manager = list((executor._processes or {}).values()), executor._executor_manager_thread
        if kill:
            _kill(processes)
        executor.shutdown(wait=kill, kill_workers=kill)
        if not kill and manager is not None:
            manager.join(_EXIT_SECONDS)
            if manager.is_alive():
                _kill(processes)
                manager.join()


def _kill(processes: Iterable[Any]) -> None:
    for process in processes:
        kill_process_tree(process)


class Workers:
    """A fixed number of workers that stay alive while a plan grows."""

    def __init__(self, count: int, output: Path) -> None:
        self._count = count
        self._idle = [_Worker(output) for _ in range(count)]
        self._busy: dict[Future[Report], tuple[list[_Worker], Job]] = {}
        self._calls: dict[Future[Any], _Worker] = {}

    @property
    def jobs(self) -> list[Job]:
        """Return the running jobs."""
        return [job for _, job in self._busy.values()]

    def has_room(self, job: Job) -> bool:
        """Whether enough workers are idle for the job's threads, or all of them."""
        return len(self._idle) >= self._needed(job)

    def submit(self, job: Job) -> None:
        """Start a job on an idle worker and reserve one more worker for each further thread.

        Raises IndexError when there is no room.
        """
        taken = [self._idle.pop() for _ in range(self._needed(job))]
        self._busy[taken[0].submit(make_shard, job)] = (taken, job)

    @property
    def idle(self) -> int:
        """Number of idle workers."""
        return len(self._idle)

    def call(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Start a call of a function on an idle worker. Raises IndexError without one."""
        worker = self._idle.pop()
        future = worker.submit(function, *arguments)
        self._calls[future] = worker
        return future

    def ended_calls(self, timeout: float) -> Iterator[Future[Any]]:
        """Yield the calls that end within `timeout` seconds; those whose worker died have an exception."""
        for future in wait(self._calls, timeout=timeout, return_when=FIRST_COMPLETED).done:
            worker = self._calls.pop(future)
            if future.exception() is not None:
                worker.stop(kill=True)
            self._idle.append(worker)
            yield future

    def _needed(self, job: Job) -> int:
        return min(job.shard.threads, self._count)

    def finished(self, timeout: float | None) -> Iterator[tuple[Job, Report | None]]:
        """Yield the jobs that end within `timeout` seconds (None: the next), with None where the worker died."""
        for future in wait(self._busy, timeout=timeout, return_when=FIRST_COMPLETED).done:
            (worker, *others), job = self._busy.pop(future)
            try:
                report: Report | None = future.result()
            except TerminatedWorkerError:
                worker.stop(kill=True)
                report = None
            except BrokenProcessPool as error:
                worker.stop(kill=True)
                report = Report(job.shard.name, "failed", f"the job did not reach its worker: {error}", repr(error))
            self._idle += [worker, *others]
            yield job, report

    def end(self, job: Job) -> None:
        """Kill the worker of a running job; another process replaces it."""
        future = next(future for future, (_, running) in self._busy.items() if running is job)
        taken, _ = self._busy.pop(future)
        taken[0].stop(kill=True)
        self._idle += taken

    def stop(self, kill: bool) -> None:
        """End all workers: at once, or after their current jobs."""
        busy = [worker for taken, _ in self._busy.values() for worker in taken]
        for worker in [*self._idle, *busy, *self._calls.values()]:
            worker.stop(kill)
        self._busy.clear()
        self._calls.clear()
