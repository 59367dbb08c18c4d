"""`make plan`: shards, samples, disk and time of a whole dataset before it starts, stage by stage.

What is done is counted. What is not is scaled up from what a sample has cost: in this dataset, as far as it is made, or
else in a short trial.
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from pipeline.config import Config
from pipeline.disk_space import byte_size
from pipeline.errors import ConfigError
from pipeline.event_log import duration_text
from pipeline.inventory import Inventory
from pipeline.paths import DatasetPaths
from pipeline.registry import upstream
from pipeline.stage import Stage
from pipeline.trial import Costs, costs_of, run_trial, short_config

_HEADER = ("stage", "shards", "samples", "disk", "time")
_TRIAL = "trial"


@dataclass(frozen=True)
class ResourceEstimate:
    """What a stage will have taken when it is done: shards, samples, bytes, seconds of work, and seconds in which each
    worker gets going. grows: whether it makes more shards as it goes on, as a search does."""

    stage: str
    shards: int
    samples: int
    size: float
    seconds: float
    warm_up: float = 0.0
    grows: bool = False

    def wall(self, workers: int) -> float:
        """Seconds with so many workers."""
        return self.seconds / workers + self.warm_up


def plan_lines(config: Config, stages: Mapping[str, Stage], places: DatasetPaths, workers: int) -> Iterator[str]:
    """A table with a row for each stage that the config uses and one for all, then what to know about it.

    Raises ConfigError where the trial fails, and where no stage says how many samples it is asked for.
    """
    producer = next((name for name, stage in stages.items() if stage.requested_samples(config)), None)
    if producer is None:
        raise ConfigError(f"{config.path}: no stage of this config says how many samples it will make")
    survey = Inventory(config, stages, places)
    costs = {name: known for name in stages if (known := _own_costs(survey, stages, name)) is not None}
    start, short = time.monotonic(), short_config(config, stages)
    tried = len(costs) < len(stages)
    if tried:
        yield "a short trial first: some thirty samples through all stages"
        below = places.work / _TRIAL
        try:
            costs = run_trial(short, stages, DatasetPaths(below, config.name, places.out)) | costs
        finally:
            shutil.rmtree(below, ignore_errors=True)
    forecasts = [_forecast(survey, stages, name, costs[name], producer, short) for name in stages]
    used = [each for each in forecasts if each.shards]
    yield from _table(used, workers)
    if tried:
        yield (
            f"about, by a trial of {duration_text(time.monotonic() - start)}: a machine with other work takes longer, "
            "and few samples may mislead"
        )
    if any(each.grows for each in used):
        yield "+: and as many more as it takes; a search slows down as it goes on, and ends when it ends"
    size, free = sum(each.size for each in used), shutil.disk_usage(places.out).free
    yield f"{byte_size(free)} are free at {places.out}" + ("" if size < free else ": that is not enough")


def _own_costs(survey: Inventory, stages: Mapping[str, Stage], name: str) -> Costs | None:
    """What the stage has cost in this dataset, or None where too little of it is made to tell."""
    if not all(survey.complete(each) for each in stages[name].inputs):
        return None
    surveyed = survey.stage(name)
    costs = costs_of(surveyed, {shard: record.seconds for shard, record in surveyed.records.items()})
    if not surveyed.missing:
        return costs
    return costs if costs.samples and not stages[name].requested_samples(survey.config) else None


def _forecast(
    survey: Inventory, stages: Mapping[str, Stage], name: str, costs: Costs, producer: str, short: Config
) -> ResourceEstimate:
    made = ResourceEstimate(
        stage=name,
        shards=costs.shards + costs.other_shards,
        samples=costs.samples,
        size=costs.samples * costs.bytes_each + costs.bytes_once,
        seconds=costs.samples * costs.seconds_each + costs.seconds_once,
        warm_up=costs.warm_up,
    )
    if survey.complete(name) or not costs.samples or producer not in upstream(stages, name):
        return made
    wanted, tried = stages[producer].requested_samples(survey.config), stages[producer].requested_samples(short)
    if survey.complete(producer):
        wanted = [record.samples for record in survey.stage(producer).records.values() if record.samples]
    samples = sum(wanted)
    # A search for more takes longer; a contact sheet of more does not.
    once = samples / sum(tried) if name == producer else 1.0
    return ResourceEstimate(
        stage=name,
        shards=len(wanted) + (0 if name == producer else costs.other_shards),
        samples=samples,
        size=samples * costs.bytes_each + once * costs.bytes_once,
        seconds=samples * costs.seconds_each + once * costs.seconds_once,
        warm_up=costs.warm_up,
        grows=name == producer and costs.other_shards > 0,
    )


def _table(forecasts: Sequence[ResourceEstimate], workers: int) -> Iterator[str]:
    whole = (
        "all",
        f"{sum(each.shards for each in forecasts):,}",
        f"{max(each.samples for each in forecasts):,}",
        byte_size(sum(each.size for each in forecasts)),
        duration_text(sum(each.wall(workers) for each in forecasts)),
    )
    rows = [_HEADER, *(_row(each, workers) for each in forecasts), whole]
    widths = [max(len(row[column]) for row in rows) for column in range(len(_HEADER))]
    for name, *cells in rows:
        yield "  ".join([name.ljust(widths[0]), *map(str.rjust, cells, widths[1:])])


def _row(each: ResourceEstimate, workers: int) -> tuple[str, ...]:
    shards = f"{each.shards:,}{'+' if each.grows else ''}"
    return (each.stage, shards, f"{each.samples:,}", byte_size(each.size), duration_text(each.wall(workers)))
