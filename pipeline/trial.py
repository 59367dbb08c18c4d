"""Trial run: the stages of a config on a few samples, to measure the cost of a sample."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from pipeline.config import Config
from pipeline.errors import ConfigError
from pipeline.inventory import Inventory, StageInventory
from pipeline.paths import DatasetPaths
from pipeline.stage import Shard, Stage
from pipeline.task import Job
from pipeline.workers import Workers

_TRIAL_SHARDS = 4
"""Number of shards with samples that a trial makes, evenly spread over the plan."""


@dataclass(frozen=True)
class Costs:
    """Measured cost of a stage.

    samples: number of samples measured
    seconds_per_sample, bytes_per_sample: cost of a sample
    shards: number of measured shards with samples
    other_shards: number of measured shards without samples
    seconds_once, bytes_once: cost of the shards without samples
    warm_up: extra seconds of a worker's first shard, for imports and compilation
    """

    samples: int
    seconds_per_sample: float
    bytes_per_sample: float
    shards: int
    other_shards: int
    seconds_once: float
    bytes_once: int
    warm_up: float = 0.0


def short_config(config: Config, stages: Mapping[str, Stage]) -> Config:
    """Return the config with each stage's section for a short run, where it has one."""
    sections = dict(config.sections)
    for name, stage in stages.items():
        if stage.trial_config is not None:
            sections[name] = stage.trial_config(config)
    return replace(config, sections=sections)


def run_trial(config: Config, stages: Mapping[str, Stage], paths: DatasetPaths) -> dict[str, Costs]:
    """Measure the cost of each stage of a short config below `paths`, in one worker, which stays as that of a run does.

    Makes the first shard of a stage twice: the difference is the warm-up. Raises ConfigError where a shard fails.
    """
    inventory = Inventory(config, stages, paths)
    costs: dict[str, Costs] = {}
    workers = Workers(1, paths.worker_output)
    try:
        for name in stages:
            paths.stage(name).make()
            costs[name] = _measured(inventory, inventory.stage(name), workers)
    finally:
        workers.stop(kill=True)
    return costs


def costs_of(state: StageInventory, seconds: Mapping[str, float], warm_up: float = 0.0) -> Costs:
    """Return the cost of the finished shards of a stage, given the seconds of each."""
    with_samples = {shard.name for shard in state.shards if _holds_samples(shard)}
    own = {name: record for name, record in state.records.items() if name in with_samples}
    other = {name: record for name, record in state.records.items() if name not in with_samples}
    samples = sum(record.samples for record in own.values())
    return Costs(
        samples=samples,
        seconds_per_sample=sum(seconds[name] for name in own) / max(samples, 1),
        bytes_per_sample=sum(record.bytes_on_disk() for record in own.values()) / max(samples, 1),
        shards=len(own),
        other_shards=len(other),
        seconds_once=sum(seconds[name] for name in other),
        bytes_once=sum(record.bytes_on_disk() for record in other.values()),
        warm_up=warm_up,
    )


def _measured(inventory: Inventory, state: StageInventory, workers: Workers) -> Costs:
    seconds: dict[str, float] = {}
    warm_up = 0.0
    chosen: set[str] = set()
    while True:
        sized = [shard.name for shard in state.shards if _holds_samples(shard)]
        chosen = chosen or {
            sized[index * len(sized) // _TRIAL_SHARDS] for index in range(_TRIAL_SHARDS if sized else 0)
        }
        ready = [
            shard
            for shard in state.missing
            if state.ready(shard) and (shard.name in chosen or not _holds_samples(shard))
        ]
        if not ready:
            return costs_of(state, seconds, warm_up)
        for shard in ready:
            first = not seconds
            job = inventory.job(state.stage.name, shard)
            seconds[shard.name] = _make(job, workers)
            if first:
                cold, seconds[shard.name] = seconds[shard.name], _make(job, workers)
                warm_up = max(cold - seconds[shard.name], 0.0)
        inventory.refresh(state.stage.name)


def _make(job: Job, workers: Workers) -> float:
    """Make a shard; return its CPU seconds."""
    workers.submit(job)
    for _, report in workers.finished(None):
        if report is not None and report.status == "done":
            return report.cpu_seconds
        message = "its worker died" if report is None else report.message
        raise ConfigError(f"the trial of {job.stage} failed, as the run would: {message}")
    raise AssertionError("a worker returns every job")


def _holds_samples(shard: Shard) -> bool:
    return "samples" in shard.params or "split" in shard.params
