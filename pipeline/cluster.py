"""Workers on other machines: a cluster of dask.distributed.

Each shard is sent to one idle worker, so that a worker that disappears fails one shard. The shard is made there in a
process of its own with the same environment as here (`pipeline/workers.py`): its bytes are the same, and a crash
leaves the cluster's worker alive. Workers may come and go. Output folder and project must have the same paths on every
machine; a worker with other code stops the run.
"""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

from pipeline.errors import ConfigError, Fatal
from pipeline.task import Job, Report
from pipeline.workers import Workers

if TYPE_CHECKING:
    from distributed import Client, Future

_ANSWER_SECONDS = 10.0
_POLL_SECONDS = 0.5

_NO_PROCESSES = (
    "the workers of the cluster may start no processes of their own: start them with --no-nanny, or with "
    "DASK_DISTRIBUTED__WORKER__DAEMON=False in their environment"
)

_process: tuple[str, Workers] | None = None
"""Run and process in which this worker of the cluster makes its shards; another run may have other code."""


class ClusterWorkers:
    """The workers of the cluster whose scheduler is at `address`, such as `tcp://10.0.0.1:8786`.

    Raises ConfigError where no scheduler answers at the start, and Fatal when it disappears later.
    """

    def __init__(self, address: str) -> None:
        self._address = address
        self._client: Client | None = None
        self._busy: dict[Future[Report | None], tuple[str, Job]] = {}

    @property
    def jobs(self) -> list[Job]:
        """The jobs that run now."""
        return [job for _, job in self._busy.values()]

    def has_room(self, job: Job) -> bool:
        """Whether a worker is idle."""
        return bool(self._idle())

    def submit(self, job: Job) -> None:
        """Start a job on an idle worker. Raises IndexError without one."""
        address = self._idle()[0]
        future = self._connected().submit(
            *(_make_here, job, self._connected().id),
            workers=[address],
            allow_other_workers=False,
            pure=False,
            retries=0,
        )
        self._busy[future] = (address, job)

    def finished(self, timeout: float | None) -> Iterator[tuple[Job, Report | None]]:
        """Yield the jobs that end within `timeout` seconds (None: the next), with None where the worker died."""
        begun = time.monotonic()
        while not any(future.done() for future in self._busy):
            if timeout is not None and time.monotonic() - begun >= timeout:
                break
            time.sleep(0.02)
        addresses = self._workers()
        for future, (address, job) in list(self._busy.items()):
            if future.done() or address not in addresses:
                del self._busy[future]
                yield job, _report(future) if future.done() else None

    def end(self, job: Job) -> None:
        """Cancel a running job: its worker kills the process that makes it."""
        future = next(future for future, (_, running) in self._busy.items() if running is job)
        del self._busy[future]
        future.cancel()

    def stop(self, kill: bool) -> None:
        """Cancel all running jobs and disconnect."""
        if self._client is not None:
            client, self._client = self._client, None
            client.close(timeout=_ANSWER_SECONDS)  # the scheduler cancels the jobs of a client that left
        self._busy.clear()

    def _idle(self) -> list[str]:
        return sorted(self._workers() - {address for address, _ in self._busy.values()})

    def _workers(self) -> set[str]:
        client = self._connected()
        try:
            return set(client.nthreads())
        except OSError as error:
            raise Fatal(f"the scheduler at {self._address} no longer answers: {error}") from error

    def _connected(self) -> Client:
        if self._client is None:
            self._client = _client(self._address)
        return self._client


def _client(address: str) -> Client:
    try:
        import dask

        # The engine reports errors; set before the import, which configures logging.
        dask.config.set({"distributed.logging": dict.fromkeys(("distributed", "distributed.client"), "critical")})
        from distributed import Client
    except ImportError as error:
        raise ConfigError(
            f"a cluster needs dask.distributed, which is not there ({error}): run `make setup-cluster`"
        ) from error
    dask.config.set({"distributed.comm.timeouts.connect": _ANSWER_SECONDS})
    try:
        return Client(address, timeout=_ANSWER_SECONDS, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ConfigError(
            f"no scheduler answers at {address} ({error}): start one, with `make cluster` on this machine"
        ) from error


def _report(future: Future[Report | None]) -> Report | None:
    """Return the report of an ended job; None where it killed its worker."""
    from concurrent.futures import CancelledError

    from distributed import KilledWorker

    try:
        report: Report | None = future.result(timeout=_ANSWER_SECONDS)
        return report
    except (CancelledError, KilledWorker, OSError):
        return None
    except Exception as error:  # anything before the shard begins, such as a missing module
        return Report("", "failed", f"its worker could not begin: {type(error).__name__}: {error}", repr(error))


def _make_here(job: Job, run: str) -> Report | None:
    """Make a shard in a worker of the cluster while the job is wanted; None where its process died."""
    global _process
    from distributed import get_worker
    from distributed.worker import thread_state

    if multiprocessing.current_process().daemon:
        return Report(job.shard.name, "fatal", _NO_PROCESSES)
    worker, key = get_worker(), thread_state.key
    if _process is None or _process[0] != run:
        if _process is not None:
            _process[1].stop(kill=True)
        _process = run, Workers(1, job.paths.worker_output)
    workers = _process[1]
    workers.submit(job)
    while True:
        for _, report in workers.finished(_POLL_SECONDS):
            return report
        task = worker.state.tasks.get(key)
        if task is None or task.state == "cancelled" or worker.status.name != "running":
            workers.end(job)
            return None
