"""Workers: each is a loky executor of one process, so that a death has one culprit and harms no other shard.

One executor with many processes would break as a whole when one of them dies, and could not say which shard it
was that killed it. Native libraries do kill (a segmentation fault, memory), so even one worker is a process of
its own. Each worker of a cluster has such a process, too (`pipeline/cluster.py`), and so has each job of a job array.
"""

from __future__ import annotations

import faulthandler
import os
import signal
import warnings
from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from pathlib import Path
from typing import Any

from joblib.externals.loky.backend.utils import kill_process_tree
from joblib.externals.loky.process_executor import BrokenProcessPool, ProcessPoolExecutor, TerminatedWorkerError

from pipeline.task import Job, Report, make_shard
from pipeline.termination import die_with_parent

WORKER_DIED = "its worker process died (out of memory, or a crash in a native library)"

_RECYCLED_AFTER = 64
"""Shards that a worker makes before a fresh process takes its place: native libraries leak."""

_SECONDS_TO_GO = 10.0
"""After these, an idle worker that was asked to go is killed: it was stopped."""


def _same_arithmetic() -> dict[str, str]:
    """OpenBLAS has kernels for each kind of processor, whose sums differ in their last digits: those for AVX2 are taken
    wherever it is there, with the blocks of one size of cache."""
    flags = Path("/proc/cpuinfo").read_text().split() if Path("/proc/cpuinfo").is_file() else []
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
"""What a worker is started with, whatever the shell says: one thread, and the same arithmetic on every machine."""

# loky itself gives a worker that has grown by 300 MB a fresh process before its next job, and warns, as if one
# were lost.
warnings.filterwarnings("ignore", message="A worker stopped while some jobs were given to the executor")


def _start_worker(parent: int, output: Path) -> None:
    """Runs first in each worker: dies with its parent, leaves Ctrl-C to it, prints into a file of the dataset."""
    die_with_parent()
    if os.getppid() != parent:
        os._exit(1)  # the parent died before it could be watched
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        descriptor = os.open(output, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    except OSError:
        return  # a full disk is found, and named, by the first shard that writes
    os.dup2(descriptor, 1)
    os.dup2(descriptor, 2)
    os.close(descriptor)
    faulthandler.enable()


class _Worker:
    def __init__(self, output: Path) -> None:
        self._output = output
        self._executor: ProcessPoolExecutor | None = None
        self._made = 0

    def submit(self, job: Job) -> Future[Report]:
        if self._executor is not None and self._made >= _RECYCLED_AFTER:
            self.stop(kill=False)
        if self._executor is None:
            self._made = 0
            self._executor = ProcessPoolExecutor(
                max_workers=1,
                timeout=None,
                initializer=_start_worker,
                initargs=(os.getpid(), self._output),
                env=_ENVIRONMENT,
            )
        self._made += 1
        future: Future[Report] = self._executor.submit(make_shard, job)
        return future

    def stop(self, kill: bool) -> None:
        """End the process: at once, or after what it does now, which it is not waited for longer than it takes to go.

        A process that was stopped (SIGSTOP) would never go by itself.
        """
        if self._executor is None:
            return
        executor, self._executor = self._executor, None
        processes, manager = list((executor._processes or {}).values()), executor._executor_manager_thread
        if kill:
            _kill(processes)
        executor.shutdown(wait=kill, kill_workers=kill)
        if not kill and manager is not None:
            manager.join(_SECONDS_TO_GO)
            if manager.is_alive():
                _kill(processes)
                manager.join()


def _kill(processes: Iterable[Any]) -> None:
    for process in processes:
        kill_process_tree(process)


class Workers:
    """A fixed number of workers that stay alive between the waves of a plan."""

    def __init__(self, count: int, output: Path) -> None:
        self._count = count
        self._idle = [_Worker(output) for _ in range(count)]
        self._busy: dict[Future[Report], tuple[list[_Worker], Job]] = {}

    @property
    def jobs(self) -> list[Job]:
        """The jobs that run now."""
        return [job for _, job in self._busy.values()]

    def has_room(self, job: Job) -> bool:
        """Whether as many workers are idle as the job has threads; or all, where it has more than there are workers."""
        return len(self._idle) >= self._places(job)

    def submit(self, job: Job) -> None:
        """Start a job on an idle worker; for each further thread of it another stays idle meanwhile.

        Raises IndexError when there is no room.
        """
        taken = [self._idle.pop() for _ in range(self._places(job))]
        self._busy[taken[0].submit(job)] = (taken, job)

    def _places(self, job: Job) -> int:
        return min(job.shard.threads, self._count)

    def finished(self, timeout: float | None) -> Iterator[tuple[Job, Report | None]]:
        """Jobs that end within `timeout` seconds (None: the next), with None for one that has killed its worker."""
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
        """Kill the worker of a running job; another takes its place."""
        future = next(future for future, (_, running) in self._busy.items() if running is job)
        taken, _ = self._busy.pop(future)
        taken[0].stop(kill=True)
        self._idle += taken

    def stop(self, kill: bool) -> None:
        """End all workers: at once, or after what they do now."""
        for worker in [*self._idle, *(worker for taken, _ in self._busy.values() for worker in taken)]:
            worker.stop(kill)
        self._busy.clear()
