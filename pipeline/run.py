"""Running stages: make every planned shard without a matching record, until each plan is complete."""

from __future__ import annotations

import fcntl
import os
import time
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from pipeline.code import code_digest
from pipeline.compilation_note import RECORD_VARIABLE
from pipeline.config import Config
from pipeline.disk_space import byte_size, check_space
from pipeline.display import duration_text
from pipeline.errors import ConfigError, Fatal
from pipeline.event_log import EventLog
from pipeline.failures import Failures
from pipeline.finish import finish_stage, publish
from pipeline.integrity import withdraw_corrupted
from pipeline.inventory import Inventory, StageInventory
from pipeline.kernel_folder import all_compiled, note_all_compiled
from pipeline.kernel_list import KernelList, compile_ahead
from pipeline.paths import DatasetPaths, fatal_cause, remove
from pipeline.progress import closing_line, shard_count_text, stage_progress
from pipeline.prune import prune_inputs
from pipeline.rebuild_reasons import rebuild_reasons
from pipeline.registry import upstream
from pipeline.remote_output import RemoteOutput
from pipeline.slices import WHOLE, Slice, locked
from pipeline.stage import Shard, Stage
from pipeline.stall_timeout import DEFAULT_STALL_MINUTES, StallWatch
from pipeline.task import Job, Report

if TYPE_CHECKING:
    from pipeline.cluster import ClusterWorkers
    from pipeline.workers import Workers

_POLL_SECONDS = 0.5
"""Between two looks at the progress of running shards."""


@dataclass
class RunResult:
    """How a run ended.

    made: number of shards made by this run
    failed: message by name of each quarantined shard
    left: number of other shards that are not made
    """

    made: int = 0
    failed: dict[str, str] = field(default_factory=dict)
    left: int = 0


@dataclass(frozen=True)
class RunOptions:
    """How a run makes shards.

    part: slice of the plan to make
    retries: number of retries of a shard that raises, before it is quarantined
    only: make only the shards named so or `<only>-<anything>`, and those of the stage that they read
    stall_minutes: minutes without progress after which a shard fails and its worker is killed; 0: never
    cluster: address of a scheduler whose workers make the shards
    target: in each stage that plans a shard of this name make it alone, with the shards of the stage that it reads
    output: store that finished shards go to
    """

    part: Slice = WHOLE
    retries: int = 2
    only: str = ""
    stall_minutes: float = DEFAULT_STALL_MINUTES
    cluster: str = ""
    target: str = ""
    output: RemoteOutput | None = None


def run_stage(
    name: str, stages: Mapping[str, Stage], config: Config, paths: DatasetPaths, workers: int, **options: Any
) -> RunResult:
    """Run one stage, as `run_stages`."""
    return run_stages([name], stages, config, paths, workers, **options)[name]


def run_stages(
    names: Iterable[str],
    stages: Mapping[str, Stage],
    config: Config,
    paths: DatasetPaths,
    workers: int,
    **options: Any,
) -> dict[str, RunResult]:
    """Make all shards of stages, in order, that have no matching record; their upstream stages must be finished.

    workers: number of workers on this machine; they start with the first shard and are kept from stage to stage
    options: fields of RunOptions

    Ends after the first stage in which a shard failed. A shard that has killed its worker three times is tried in
    isolation, then quarantined. The rest goes on. A corrupted input, of whatever stage, is rebuilt first.

    Raises ConfigError when nothing can start (an upstream stage is unfinished, the disk is too small, another run
    works here), and Fatal when everything had to stop. Complete files and their records stay for the next run.
    """
    names, results = list(names), dict[str, RunResult]()
    output = RunOptions(**options).output
    shared = _Shared(names, stages, paths, Inventory(config, stages, paths), workers, RunOptions(**options).cluster)
    shared.inventory.code_of(names)  # before any worker starts
    try:
        for name in names:
            results[name] = _run_stage(name, shared, RunOptions(**options))
            if results[name].failed:
                break
    except BaseException:
        shared.stop_workers(kill=True)
        if output:
            output.finish(whole=False)
        raise
    shared.stop_workers(kill=False)
    if output:
        output.finish(
            whole=all(shared.inventory.complete(name) for name in stages if not stages[name].publishes_incomplete)
        )
    return results


class _Shared:
    """What the stages of a run share: plans and records, and the workers, which start with the first shard."""

    def __init__(
        self,
        names: Sequence[str],
        stages: Mapping[str, Stage],
        paths: DatasetPaths,
        inventory: Inventory,
        count: int,
        cluster: str,
    ) -> None:
        self._names = names
        self._kernels_compiled = False
        self.stages = stages
        self.paths = paths
        self.inventory = inventory
        self._count = count
        self._cluster = cluster
        self._workers: Workers | ClusterWorkers | None = None

    @property
    def workers(self) -> Workers | ClusterWorkers:
        if self._workers is None:
            self._workers = _cluster_workers(self._cluster) if self._cluster else _workers(self._count, self.paths)
        return self._workers

    def compile_kernels(self, log: EventLog) -> None:
        """Compile the kernels that the stages of the run use, before its first shard."""
        if self._kernels_compiled or self._cluster or RECORD_VARIABLE in os.environ:
            return
        self._kernels_compiled = True
        config, listed = self.inventory.config, KernelList.read()
        producers = [name for name, stage in self.stages.items() if stage.requested_samples(config)]
        indices = listed.indices(producers, self._names)
        code = self.inventory.code_of(self._names) | listed.names(indices)
        if not indices or all_compiled(code_digest(code)):
            return
        from pipeline.workers import Workers

        assert isinstance(self.workers, Workers)
        start = time.monotonic()
        compiled = compile_ahead(listed, indices, self.workers, log.show_compilation)
        if compiled:
            log.say(f"{compiled} kernels compiled in {duration_text(time.monotonic() - start)}, once on this machine")
        note_all_compiled(code_digest(code))

    def stop_workers(self, kill: bool) -> None:
        """End all workers: at once, or after their current jobs."""
        if self._workers is not None:
            self._workers.stop(kill)


# Imported with the first shard: a run that finds nothing to make needs neither.
def _workers(count: int, paths: DatasetPaths) -> Workers:
    from pipeline.workers import Workers

    return Workers(count, paths.worker_output)


def _cluster_workers(address: str) -> ClusterWorkers:
    from pipeline.cluster import ClusterWorkers

    return ClusterWorkers(address)


def _run_stage(name: str, shared: _Shared, options: RunOptions, wait: bool = False) -> RunResult:
    """Run one stage; `wait`: for another run of the stage, which would else be an error."""
    own = shared.paths.stage(name)
    own.make()
    log = EventLog(name, shared.paths.log)
    try:
        with locked(own, options.part, wait) as lock:
            return _Run(name, shared, options, log).make(lock)
    except OSError as error:
        if fatal_cause(error) is None:
            raise
        raise Fatal(f"{error.strerror}: {error.filename or own.root}") from error
    finally:
        log.close()


class _Run:
    def __init__(self, name: str, shared: _Shared, options: RunOptions, log: EventLog) -> None:
        self._name = name
        self._shared = shared
        self._options = options
        self._log = log
        self._stages = shared.stages
        self._paths = shared.paths
        self._inventory = shared.inventory
        self._result = RunResult()
        self._made: set[str] = set()
        self._corrupted: dict[str, str] = {}
        self._rebuilt: set[str] = set()
        self._failures = Failures(shared.paths.stage(name), log, options.retries, self._result.failed)
        self._stall_watch = StallWatch(options.stall_minutes, shared.paths.stage(name))
        self._shown = 0.0

    def make(self, lock: BinaryIO) -> RunResult:
        """Make missing shards, then finish the stage if it is complete."""
        self._check_upstream()
        state = self._inventory.stage(self._name)
        self._delete(state, state.paths.failed, "*")
        self._delete_unfinished(state)
        if state.missing:
            self._check_environment()
            for line in rebuild_reasons(state):
                self._log.say(line)
            remove(state.paths.manifest)
            missing = len(self._mine(state))
            self._log.say(f"{shard_count_text(missing)} to make, {check_space(state, self._paths.out)}")
            self._shared.compile_kernels(self._log)
            self._make_missing()
            state = self._inventory.stage(self._name)
        if not state.missing:
            fcntl.flock(lock, fcntl.LOCK_EX)
            finish_stage(self._inventory, self._name, self._paths)
            self._prune()
        elif state.stage.publishes_incomplete:
            fcntl.flock(lock, fcntl.LOCK_EX)
            publish(state, self._paths)
        self._close(state)
        return self._result

    def _prune(self) -> None:
        """Prune intermediate files after the last stage, if the config asks for it."""
        last = not any(self._name in stage.inputs for stage in self._stages.values())
        if last and self._inventory.config.keep == "dataset" and not self._stages[self._name].publishes_incomplete:
            freed = prune_inputs(self._inventory, self._stages, self._name)
            if freed:
                self._log.say(f"{self._name}: {byte_size(freed)} of intermediate files pruned")

    def _check_upstream(self) -> None:
        if self._options.target or not self._stages[self._name].uses_input(self._inventory.config, self._options.only):
            return  # a target's inputs are made, and much else is not
        above = [read for read in upstream(self._stages, self._name) if read != self._name]
        if any(self._inventory.stage(read).missing for read in above):
            self._inventory.reread()  # other runs, of other slices, may have made them
        for read in above:
            missing = self._inventory.stage(read).missing
            if missing:
                planned = len(self._inventory.stage(read).shards)
                raise ConfigError(
                    f"{self._name} reads {read}, and {len(missing)} of its {planned} shards are not made "
                    f"(the first is {missing[0].name}): run stage {read} first"
                )

    def _check_environment(self) -> None:
        """Check this stage; a stage without inputs, with which a dataset begins, checks all later stages too."""
        begins = not self._stages[self._name].inputs
        for name, stage in self._stages.items():
            if name == self._name or (begins and self._name in upstream(self._stages, name)):
                stage.check_environment(self._inventory.config)

    def _delete_unfinished(self, state: StageInventory) -> None:
        """Delete half-written files of this slice, which a killed worker leaves."""
        for folder in (state.paths.root, state.paths.rejects, state.paths.records):
            self._delete(state, folder, ".*.tmp")
        self._delete(state, state.paths.progress, "*")

    def _delete(self, state: StageInventory, folder: Path, pattern: str) -> None:
        mine = {shard.name for index, shard in enumerate(state.shards) if index in self._options.part}
        for path in folder.glob(pattern):
            if self._options.part == WHOLE or path.name.lstrip(".").partition(".")[0] in mine:
                remove(path)

    def _mine(self, state: StageInventory) -> list[Shard]:
        wanted, part = self._wanted(state) - set(state.records) - set(self._result.failed), self._options.part
        return [shard for index, shard in enumerate(state.shards) if index in part and shard.name in wanted]

    def _wanted(self, state: StageInventory) -> set[str]:
        """Return the requested shards and those that they read. Raises ConfigError without any."""
        names, only = [shard.name for shard in state.shards], self._options.only
        wanted = {name for name in names if not only or f"{name}-".startswith(f"{only}-")}
        if self._options.target in names:
            wanted = {self._options.target}
        if not wanted and names:
            raise ConfigError(f"{self._name} has no shards {only} or {only}-...; it has {', '.join(names)}")
        for shard in reversed(state.shards):  # a shard's inputs are planned before it
            if shard.name in wanted:
                own = (source.partition("/") for source in shard.inputs)
                wanted |= {name for stage, _, name in own if stage == self._name}
        return wanted

    def _make_missing(self) -> None:
        state = self._inventory.stage(self._name)
        try:
            while True:
                mine = (shard for shard in self._mine(state) if state.ready(shard))
                ready = deque(self._inventory.job(self._name, shard) for shard in mine)
                if not ready:
                    break
                self._make(self._shared.workers, ready, state)
                if self._corrupted:
                    self._mend()
                    state = self._inventory.stage(self._name)
                else:
                    self._inventory.refresh(self._name)
                self._check_plan(state)
        except BaseException as error:
            self._shared.stop_workers(kill=True)
            self._log.note(f"stopped: {type(error).__name__}: {error}")
            raise
        finally:
            self._delete_unfinished(state)

    def _check_plan(self, state: StageInventory) -> None:
        # Without this, a plan that draws a number or reads a clock would never end.
        for shard in state.missing:
            if shard.name in self._made:
                raise ValueError(
                    f"plan of {self._name}: shard {shard.name} was just made, and its plan has changed since: "
                    "a plan depends only on the config and on records"
                )

    def _mend(self) -> None:
        """Rebuild corrupted shards: here, or first by a run of the stage that they belong to.

        Shards made from them before have read the right bytes, and stay if the same bytes come back. Raises Fatal for
        corruption of a shard that was just rebuilt.
        """
        for source, message in self._corrupted.items():
            if not withdraw_corrupted(self._paths, source):
                continue  # another run has rebuilt it
            stage, _, shard = source.partition("/")
            if shard in self._inventory.stage(stage).pruned:
                message = f"{source} was pruned"
            if source in self._rebuilt:
                raise Fatal(f"{message}, and {shard} was just rebuilt: disk or memory cannot be trusted")
            self._log.say(f"{message}; {shard} is rebuilt")
            self._rebuilt.add(source)
        self._corrupted.clear()
        self._made.clear()
        self._inventory.reread()
        for read in upstream(self._stages, self._name):
            if read != self._name and self._inventory.stage(read).missing:
                _run_stage(read, self._shared, replace(self._options, part=WHOLE, only=""), wait=True)
                self._inventory.reread()
        self._check_upstream()

    def _make(self, workers: Workers | ClusterWorkers, ready: deque[Job], state: StageInventory) -> None:
        """Make the `ready` shards, until each is done or quarantined."""
        isolated = self._failures.isolated
        while ready or isolated or workers.jobs:
            while ready and workers.has_room(ready[0]):
                workers.submit(ready.popleft())
            if isolated and not workers.jobs:
                workers.submit(isolated.popleft())
            for job, report in workers.finished(_POLL_SECONDS):
                self._stall_watch.restart(job.shard.name)
                self._handle_report(job, report, ready)
            for job in self._stall_watch.stalled(workers.jobs):
                self._give_up(job, workers, ready)
            if time.monotonic() - self._shown >= _POLL_SECONDS:
                self._shown = time.monotonic()
                running = [job.shard.name for job in workers.jobs]
                self._log.show(stage_progress(state, running, len(self._result.failed)))

    def _handle_report(self, job: Job, report: Report | None, ready: deque[Job]) -> None:
        if report is None:
            self._failures.death(job, ready)
        elif report.status == "done":
            self._result.made += 1
            self._made.add(job.shard.name)
            self._inventory.accept(self._name, job.shard.name)
            if self._options.output:
                self._options.output.shard_done(self._name, job.shard.name)
        elif report.status == "corrupted":
            self._corrupted[report.corrupted] = report.message
        else:
            self._failures.failure(job, report, ready)

    def _give_up(self, job: Job, workers: Workers | ClusterWorkers, ready: deque[Job]) -> None:
        """Kill the worker of a shard that makes no progress."""
        workers.end(job)
        self._stall_watch.restart(job.shard.name)
        message = f"it made no progress for {duration_text(self._stall_watch.seconds)}, and its worker was killed"
        self._log.say(f"shard {job.shard.name}: {message}")
        self._failures.failure(job, Report(job.shard.name, "failed", message), ready)

    def _close(self, state: StageInventory) -> None:
        self._log.close()
        result = self._result
        result.left = len(state.missing) - len(result.failed)
        # A stage that the config does not use writes to the log alone.
        say = self._log.say if state.shards else self._log.note
        say(closing_line(state, result.made, result.failed, result.left))
        for line in state.stage.report(state.view):
            self._log.say(line)
