"""Consequences of a failed shard: a retry, a retry in isolation, or quarantine while the rest goes on."""

from __future__ import annotations

from collections import Counter, deque

from pipeline.errors import Fatal
from pipeline.event_log import EventLog
from pipeline.paths import StagePaths, write_atomically
from pipeline.records import fingerprint
from pipeline.shards import json_bytes
from pipeline.task import Job, Report

_DEATHS_BEFORE_ISOLATION = 3
_WORKER_DIED = "its worker process died (out of memory, or a crash in a native library)"


class Failures:
    """Counts the failures of one run of a stage.

    quarantined: message by name of each shard that is not tried again in this run
    isolated: jobs that are tried while no other shard runs
    """

    def __init__(self, paths: StagePaths, log: EventLog, retries: int, quarantined: dict[str, str]) -> None:
        self.quarantined = quarantined
        self.isolated: deque[Job] = deque()
        self._paths = paths
        self._log = log
        self._retries = retries
        self._failed: Counter[str] = Counter()
        self._died: Counter[str] = Counter()

    def death(self, job: Job, ready: deque[Job]) -> None:
        """Handle a shard that killed its worker: retry it twice, then in isolation, then quarantine it."""
        self._died[job.shard.name] += 1
        deaths = self._died[job.shard.name]
        self._log.note(f"{job.shard.name}: {_WORKER_DIED}, time {deaths}")
        if deaths < _DEATHS_BEFORE_ISOLATION:
            ready.append(job)
        elif deaths == _DEATHS_BEFORE_ISOLATION:
            self.isolated.append(job)
        else:
            message = f"{_WORKER_DIED}, {deaths} times, the last in isolation"
            self._quarantine(job, Report(job.shard.name, "failed", message))

    def failure(self, job: Job, report: Report, ready: deque[Job]) -> None:
        """Handle a failed shard: retry it, then quarantine it. Raises Fatal for what would fail every shard."""
        if report.status == "fatal":
            self._log.note(report.trace)
            raise Fatal(f"shard {job.shard.name} of {job.stage}: {report.message}")
        self._failed[job.shard.name] += 1
        if report.status == "failed" and self._failed[job.shard.name] <= self._retries:
            self._log.note(f"{job.shard.name} failed and is retried: {report.message}\n{report.trace}")
            ready.append(job)
        else:
            self._quarantine(job, report)

    def _quarantine(self, job: Job, report: Report) -> None:
        name = job.shard.name
        self.quarantined[name] = report.message
        self._log.say(f"shard {name} is quarantined: {report.message}")
        self._log.note(report.trace)
        failure = {"fingerprint": fingerprint(job.recipe), "message": report.message, "trace": report.trace}
        write_atomically(self._paths.failed / f"{name}.json", json_bytes(failure))
