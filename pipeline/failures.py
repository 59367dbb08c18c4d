"""What a failed shard costs: another try, one with nothing beside it, or that it is set aside and the rest goes on."""

from __future__ import annotations

from collections import Counter, deque

from pipeline.errors import Fatal
from pipeline.event_log import EventLog
from pipeline.paths import StagePaths, write_atomically
from pipeline.records import fingerprint
from pipeline.shards import json_bytes
from pipeline.task import Job, Report

_DEATHS_BEFORE_ALONE = 3


class Failures:
    """Counts what goes wrong in one run of a stage. `aside`: the shards that were set aside, and why; `alone`: those
    that are to be tried with nothing beside them."""

    def __init__(self, places: StagePaths, journal: EventLog, retries: int, aside: dict[str, str]) -> None:
        self.aside = aside
        self.alone: deque[Job] = deque()
        self._places = places
        self._journal = journal
        self._retries = retries
        self._failed: Counter[str] = Counter()
        self._died: Counter[str] = Counter()

    def death(self, job: Job, cause: str, ready: deque[Job]) -> None:
        """A shard has killed its worker: it goes back to `ready` twice, then it is tried alone, then set aside."""
        self._died[job.shard.name] += 1
        deaths = self._died[job.shard.name]
        self._journal.note(f"{job.shard.name}: {cause}, time {deaths}")
        if deaths < _DEATHS_BEFORE_ALONE:
            ready.append(job)
        elif deaths == _DEATHS_BEFORE_ALONE:
            self.alone.append(job)
        else:
            self._set_aside(job, Report(job.shard.name, "failed", f"{cause}, {deaths} times, at last alone"))

    def failure(self, job: Job, report: Report, ready: deque[Job]) -> None:
        """A shard has failed: it goes back to `ready` as often as is wanted, then it is set aside.

        Raises Fatal for what no other shard would survive either.
        """
        if report.status == "fatal":
            self._journal.note(report.trace)
            raise Fatal(f"shard {job.shard.name} of {job.stage}: {report.message}")
        self._failed[job.shard.name] += 1
        if report.status == "failed" and self._failed[job.shard.name] <= self._retries:
            self._journal.note(f"{job.shard.name} failed and is tried again: {report.message}\n{report.trace}")
            ready.append(job)
        else:
            self._set_aside(job, report)

    def _set_aside(self, job: Job, report: Report) -> None:
        name = job.shard.name
        self.aside[name] = report.message
        self._journal.say(f"shard {name} is set aside: {report.message}")
        self._journal.note(report.trace)
        described = {"fingerprint": fingerprint(job.recipe), "message": report.message, "trace": report.trace}
        write_atomically(self._places.failed / f"{name}.json", json_bytes(described))
