"""A trial: the stages of a config on a few samples, to learn what a sample costs before hours are spent."""

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

_SHARDS = 4
"""So many shards of samples are made, evenly spread over the plan."""


@dataclass(frozen=True)
class Costs:
    """What a stage costs: for each sample, and for what is done once, in shards without samples.

    samples, shards, other_shards: on how many samples this was measured, in how many shards with samples and without;
    warm_up: seconds that each worker spends on its first shard alone, to load and compile.
    """

    samples: int
    seconds_each: float
    bytes_each: float
    shards: int
    other_shards: int
    seconds_once: float
    bytes_once: int
    warm_up: float = 0.0


def short_config(config: Config, stages: Mapping[str, Stage]) -> Config:
    """The config with the section for a short run of each stage that has one."""
    sections = dict(config.sections)
    for name, stage in stages.items():
        if stage.trial_config is not None:
            sections[name] = stage.trial_config(config)
    return replace(config, sections=sections)


def run_trial(config: Config, stages: Mapping[str, Stage], places: DatasetPaths) -> dict[str, Costs]:
    """What each stage of a short config costs, measured in one worker each below `places`.

    The first shard of a stage is made twice: what the second time takes less, a worker pays once. Raises ConfigError
    where a shard fails: so would the run.
    """
    survey = Inventory(config, stages, places)
    costs: dict[str, Costs] = {}
    for name in stages:
        places.stage(name).make()
        workers = Workers(1, places.worker_output)
        try:
            costs[name] = _measured(survey, survey.stage(name), workers)
        finally:
            workers.stop(kill=True)
    return costs


def costs_of(surveyed: StageInventory, seconds: Mapping[str, float], warm_up: float = 0.0) -> Costs:
    """What the finished shards of a stage have cost, where each has taken so many `seconds`."""
    with_samples = {shard.name for shard in surveyed.shards if _holds_samples(shard)}
    own = {name: record for name, record in surveyed.records.items() if name in with_samples}
    other = {name: record for name, record in surveyed.records.items() if name not in with_samples}
    samples = sum(record.samples for record in own.values())
    return Costs(
        samples=samples,
        seconds_each=sum(seconds[name] for name in own) / max(samples, 1),
        bytes_each=sum(record.bytes_on_disk() for record in own.values()) / max(samples, 1),
        shards=len(own),
        other_shards=len(other),
        seconds_once=sum(seconds[name] for name in other),
        bytes_once=sum(record.bytes_on_disk() for record in other.values()),
        warm_up=warm_up,
    )


def _measured(survey: Inventory, surveyed: StageInventory, workers: Workers) -> Costs:
    seconds: dict[str, float] = {}
    warm_up = 0.0
    chosen: set[str] = set()
    while True:
        sized = [shard.name for shard in surveyed.shards if _holds_samples(shard)]
        chosen = chosen or {sized[place * len(sized) // _SHARDS] for place in range(_SHARDS if sized else 0)}
        ready = [
            shard
            for shard in surveyed.missing
            if surveyed.ready(shard) and (shard.name in chosen or not _holds_samples(shard))
        ]
        if not ready:
            return costs_of(surveyed, seconds, warm_up)
        for shard in ready:
            first = not seconds
            job = survey.job(surveyed.stage.name, shard)
            seconds[shard.name] = _make(job, workers)
            if first:
                cold, seconds[shard.name] = seconds[shard.name], _make(job, workers)
                warm_up = max(cold - seconds[shard.name], 0.0)
        survey.refresh(surveyed.stage.name)


def _make(job: Job, workers: Workers) -> float:
    """Make a shard; the seconds that processors were busy with it, whatever else they had to do."""
    workers.submit(job)
    for _, report in workers.finished(None):
        if report is not None and report.status == "done":
            return report.cpu_seconds
        message = "its worker died" if report is None else report.message
        raise ConfigError(f"the trial of {job.stage} failed, as the run would: {message}")
    raise AssertionError("a worker ends what it is given")


def _holds_samples(shard: Shard) -> bool:
    return "samples" in shard.params or "split" in shard.params
