"""Running a stage: every planned shard without a matching record is made, until the plan has no more to ask."""

from __future__ import annotations

import fcntl
import time
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from pipeline.cluster import ClusterWorkers
from pipeline.config import Config
from pipeline.disk_space import byte_size, check_space
from pipeline.errors import ConfigError, Fatal
from pipeline.event_log import EventLog, duration_text
from pipeline.failures import Failures
from pipeline.finish import finish_stage, publish
from pipeline.integrity import withdraw_corrupted
from pipeline.inventory import Inventory, StageInventory
from pipeline.paths import DatasetPaths, fatal_cause, remove
from pipeline.progress import closing_line, shard_count_text, stage_progress
from pipeline.prune import prune_inputs
from pipeline.rebuild_reasons import rebuild_reasons
from pipeline.registry import upstream
from pipeline.slices import WHOLE, Slice, locked
from pipeline.stage import Shard, Stage
from pipeline.stall_timeout import DEFAULT_STALL_MINUTES, StallWatch
from pipeline.task import Job, Report
from pipeline.workers import WORKER_DIED, Workers

_LOOK_EVERY = 0.5
"""Seconds between two looks at how far the running shards are."""


@dataclass
class RunResult:
    """How a run ended: shards made now, shards set aside and why, shards that neither is true of."""

    made: int = 0
    failed: dict[str, str] = field(default_factory=dict)
    left: int = 0


def run_stage(
    name: str,
    stages: Mapping[str, Stage],
    config: Config,
    places: DatasetPaths,
    workers: int,
    part: Slice = WHOLE,
    retries: int = 2,
    waits: bool = False,
    only: str = "",
    stall_minutes: float = DEFAULT_STALL_MINUTES,
    cluster: str = "",
) -> RunResult:
    """Make all shards of stage `name` that have no matching record; the stages that these read must be finished.

    `cluster`: the address of a scheduler whose workers make the shards, in place of `workers` on this machine.
    `only`: make no more than the shards called so, or `<only>-<anything>`, and those of the stage that they read.

    A shard that raises is tried again `retries` times, then set aside; one that has killed its worker three times
    is run once more with nothing beside it, then set aside. One that makes no progress for `stall_minutes` minutes has
    failed like one that raises, and its worker is ended; 0 waits for ever. The rest goes on. An input that is found
    damaged is made again first, of whatever stage it is. `waits`: another run that is at work here is waited for.

    Raises ConfigError when nothing can start (an earlier stage is unfinished, the disk is too small, another run
    is at work here) and Fatal when everything had to stop; whole files and their records are left, and the next
    run goes on from there.
    """
    own = places.stage(name)
    own.make()
    journal = EventLog(name, places.log)
    try:
        with locked(own, part, waits) as lock:
            return _Run(
                name, stages, config, places, workers, part, retries, journal, only, stall_minutes, cluster
            ).through(lock)
    except OSError as error:
        if fatal_cause(error) is None:
            raise
        raise Fatal(f"{error.strerror}: {error.filename or own.root}") from error
    finally:
        journal.close()


class _Run:
    def __init__(
        self,
        name: str,
        stages: Mapping[str, Stage],
        config: Config,
        places: DatasetPaths,
        workers: int,
        part: Slice,
        retries: int,
        journal: EventLog,
        only: str,
        stall_minutes: float,
        cluster: str,
    ) -> None:
        self._name = name
        self._stages = stages
        self._places = places
        self._workers = workers
        self._part = part
        self._retries = retries
        self._journal = journal
        self._only = only
        self._cluster = cluster
        self._survey = Inventory(config, stages, places)
        self._result = RunResult()
        self._made: set[str] = set()
        self._damaged: dict[str, str] = {}
        self._mended: set[str] = set()
        self._failures = Failures(places.stage(name), journal, retries, self._result.failed)
        self._stall_watch = StallWatch(stall_minutes, places.stage(name))
        self._shown = 0.0

    def through(self, lock: BinaryIO) -> RunResult:
        """Make what is missing, then finish the stage if it is complete."""
        self._check_upstream()
        surveyed = self._survey.stage(self._name)
        self._take_away(surveyed, surveyed.paths.failed, "*")
        self._take_away_unfinished(surveyed)
        if surveyed.missing:
            self._check_machine()
            for line in rebuild_reasons(surveyed):
                self._journal.say(line)
            remove(surveyed.paths.manifest)
            missing = len(self._mine(surveyed))
            self._journal.say(f"{shard_count_text(missing)} to make, {check_space(surveyed, self._places.out)}")
            self._make_missing()
            surveyed = self._survey.stage(self._name)
        if not surveyed.missing:
            fcntl.flock(lock, fcntl.LOCK_EX)
            finish_stage(self._survey, self._name, self._places)
            self._let_go()
        elif surveyed.stage.publishes_incomplete:
            fcntl.flock(lock, fcntl.LOCK_EX)
            publish(surveyed, self._places)
        self._close(surveyed)
        return self._result

    def _let_go(self) -> None:
        """Where the config says so, take away what the last stage was made of."""
        last = not any(self._name in stage.inputs for stage in self._stages.values())
        if last and self._survey.config.keep == "dataset" and not self._stages[self._name].publishes_incomplete:
            freed = prune_inputs(self._survey, self._stages, self._name)
            if freed:
                self._journal.say(f"{self._name}: {byte_size(freed)} of what lies between taken away")

    def _check_upstream(self) -> None:
        if not self._stages[self._name].uses_input(self._survey.config, self._only):
            return
        for each in upstream(self._stages, self._name):
            missing = [] if each == self._name else self._survey.stage(each).missing
            if missing:
                planned = len(self._survey.stage(each).shards)
                raise ConfigError(
                    f"{self._name} reads {each}, and {len(missing)} of its {planned} shards are not made "
                    f"(the first is {missing[0].name}): run stage {each} first"
                )

    def _check_machine(self) -> None:
        """Ask the stage; and where it reads none, so that a dataset begins with it, all that come after it too."""
        begins = not self._stages[self._name].inputs
        for each, stage in self._stages.items():
            if each == self._name or (begins and self._name in upstream(self._stages, each)):
                stage.check_environment(self._survey.config)

    def _take_away_unfinished(self, surveyed: StageInventory) -> None:
        """Take away what this part left half written; a worker that was killed could not do it."""
        for folder in (surveyed.paths.root, surveyed.paths.rejects, surveyed.paths.records):
            self._take_away(surveyed, folder, ".*.tmp")
        self._take_away(surveyed, surveyed.paths.progress, "*")

    def _take_away(self, surveyed: StageInventory, folder: Path, pattern: str) -> None:
        mine = {shard.name for index, shard in enumerate(surveyed.shards) if index in self._part}
        for path in folder.glob(pattern):
            if self._part == WHOLE or path.name.lstrip(".").partition(".")[0] in mine:
                remove(path)

    def _mine(self, surveyed: StageInventory) -> list[Shard]:
        done, failed, chosen = surveyed.records, self._result.failed, self._chosen(surveyed)
        return [
            shard
            for index, shard in enumerate(surveyed.shards)
            if index in self._part and shard.name in chosen and shard.name not in done and shard.name not in failed
        ]

    def _chosen(self, surveyed: StageInventory) -> set[str]:
        """The shards that were asked for and those that they read. Raises ConfigError where there is none."""
        chosen = {
            each.name for each in surveyed.shards if not self._only or f"{each.name}-".startswith(f"{self._only}-")
        }
        if not chosen and surveyed.shards:
            planned = ", ".join(each.name for each in surveyed.shards)
            raise ConfigError(f"{self._name} has no shards {self._only} or {self._only}-...; there are {planned}")
        for shard in reversed(surveyed.shards):  # what a shard reads is planned before it
            if shard.name in chosen:
                chosen |= {each.partition("/")[2] for each in shard.inputs if each.startswith(f"{self._name}/")}
        return chosen

    def _make_missing(self) -> None:
        workers = ClusterWorkers(self._cluster) if self._cluster else Workers(self._workers, self._places.worker_output)
        surveyed = self._survey.stage(self._name)
        try:
            while True:
                mine = (shard for shard in self._mine(surveyed) if surveyed.ready(shard))
                ready = deque(self._survey.job(self._name, shard) for shard in mine)
                if not ready:
                    break
                self._make(workers, ready, surveyed)
                if self._damaged:
                    workers.stop(kill=False)
                    self._mend()
                    surveyed = self._survey.stage(self._name)
                else:
                    self._survey.refresh(self._name)
                self._check_plan(surveyed)
            workers.stop(kill=False)
        except BaseException as error:
            workers.stop(kill=True)
            self._journal.note(f"stopped: {type(error).__name__}: {error}")
            raise
        finally:
            self._take_away_unfinished(surveyed)

    def _check_plan(self, surveyed: StageInventory) -> None:
        # Without this, a plan that draws a number or reads a clock would have its shards made for ever.
        for shard in surveyed.missing:
            if shard.name in self._made:
                raise ValueError(
                    f"plan of {self._name}: shard {shard.name} was made just now, and is planned otherwise since: "
                    "a plan is a function of the config and of records alone"
                )

    def _mend(self) -> None:
        """Have what was found damaged made again: here, or first of all by a run of the stage that it belongs to.

        What was made of it before has read good bytes, and stays as long as these come back. Raises Fatal for damage
        to what was made again just before.
        """
        for source, message in self._damaged.items():
            if not withdraw_corrupted(self._places, source):
                continue  # another run has made it again
            stage, _, shard = source.partition("/")
            if shard in self._survey.stage(stage).pruned:
                message = f"{source} was let go of"
            if source in self._mended:
                raise Fatal(f"{message}, and {shard} was made again just now: disk or memory cannot be trusted")
            self._journal.say(f"{message}; {shard} is made again")
            self._mended.add(source)
        self._damaged.clear()
        self._made.clear()
        self._survey.reread()
        for each in upstream(self._stages, self._name):
            if each != self._name and self._survey.stage(each).missing:
                run_stage(
                    *(each, self._stages, self._survey.config, self._places, self._workers),
                    retries=self._retries,
                    waits=True,
                    stall_minutes=self._stall_watch.seconds / 60,
                    cluster=self._cluster,
                )
                self._survey.reread()
        self._check_upstream()

    def _make(self, workers: Workers | ClusterWorkers, ready: deque[Job], surveyed: StageInventory) -> None:
        """Make the `ready` shards, each until it is done or set aside."""
        alone = self._failures.alone
        while ready or alone or workers.jobs:
            while ready and workers.has_room(ready[0]):
                workers.submit(ready.popleft())
            if alone and not workers.jobs:
                workers.submit(alone.popleft())
            for job, report in workers.finished(_LOOK_EVERY):
                self._stall_watch.begin_anew(job.shard.name)
                self._take_in(job, report, ready)
            for job in self._stall_watch.lost_with(workers.jobs):
                self._give_up(job, workers, ready)
            if time.monotonic() - self._shown >= _LOOK_EVERY:
                self._shown = time.monotonic()
                running = [job.shard.name for job in workers.jobs]
                self._journal.show(stage_progress(surveyed, running, len(self._result.failed)))

    def _take_in(self, job: Job, report: Report | None, ready: deque[Job]) -> None:
        if report is None:
            self._failures.death(job, WORKER_DIED, ready)
        elif report.status == "done":
            self._result.made += 1
            self._made.add(job.shard.name)
            self._survey.accept(self._name, job.shard.name)
        elif report.status == "damaged":
            self._damaged[report.damaged] = report.message
        else:
            self._failures.failure(job, report, ready)

    def _give_up(self, job: Job, workers: Workers | ClusterWorkers, ready: deque[Job]) -> None:
        """End a shard that shows no sign of work, with its worker."""
        workers.end(job)
        self._stall_watch.begin_anew(job.shard.name)
        message = f"it made no progress for {duration_text(self._stall_watch.seconds)}, and its worker was ended"
        self._journal.say(f"shard {job.shard.name}: {message}")
        self._failures.failure(job, Report(job.shard.name, "failed", message), ready)

    def _close(self, surveyed: StageInventory) -> None:
        self._journal.close()
        result = self._result
        result.left = len(surveyed.missing) - len(result.failed)
        # Of a stage that the config has no use for nobody wants to hear.
        say = self._journal.say if surveyed.shards else self._journal.note
        say(closing_line(surveyed, result.made, result.failed, result.left))
        for line in surveyed.stage.report(surveyed.view):
            self._journal.say(line)
