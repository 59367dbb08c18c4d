"""`make plan`: estimates of shards, samples, disk and time of a dataset, stage by stage.

Finished work is counted. The rest is extrapolated from the cost of a sample, measured in this dataset or in a short
trial.
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from pipeline.config import Config
from pipeline.disk_space import byte_size
from pipeline.display import duration_text
from pipeline.errors import ConfigError
from pipeline.inventory import Inventory
from pipeline.paths import DatasetPaths
from pipeline.registry import upstream
from pipeline.stage import Stage
from pipeline.trial import Costs, costs_of, run_trial, short_config

_HEADER = ("stage", "shards", "samples", "disk", "time")
_TRIAL_FOLDER = "trial"


@dataclass(frozen=True)
class ResourceEstimate:
    """Resources that a stage will have used when it is done.

    size: bytes on disk
    seconds: CPU time
    warm_up: seconds of a worker before its first shard
    grows: whether the number of shards is a lower bound, as in a search
    """

    stage: str
    shards: int
    samples: int
    size: float
    seconds: float
    warm_up: float = 0.0
    grows: bool = False

    def wall(self, workers: int) -> float:
        """Return the seconds by the clock with a number of workers."""
        return self.seconds / workers + self.warm_up


def plan_lines(config: Config, stages: Mapping[str, Stage], paths: DatasetPaths, workers: int) -> Iterator[str]:
    """Yield a table with a row for each stage that the config uses and one for the total, then notes.

    Raises ConfigError where the trial fails, and where no stage has requested samples.
    """
    asked = [name for name, stage in stages.items() if stage.requested_samples(config)]
    if not asked:
        raise ConfigError(f"{config.path}: no stage of this config says how many samples it will make")
    inventory = Inventory(config, stages, paths)
    costs = {name: known for name in stages if (known := _own_costs(inventory, stages, name)) is not None}
    start, short = time.monotonic(), short_config(config, stages)
    tried = len(costs) < len(stages)
    if tried:
        yield "running a short trial: about thirty samples through all stages"
        below = paths.work / _TRIAL_FOLDER
        try:
            costs = run_trial(short, stages, DatasetPaths(below, config.name, paths.out)) | costs
        finally:
            shutil.rmtree(below, ignore_errors=True)
    estimates = []
    for name in stages:
        read = upstream(stages, name)
        producer = next((maker for maker in reversed(asked) if maker in read), asked[-1])
        estimates.append(_estimate(inventory, stages, name, costs[name], producer, short))
    used = [estimate for estimate in estimates if estimate.shards]
    yield from _table(used, workers)
    if tried:
        yield (
            f"estimated by a trial of {duration_text(time.monotonic() - start)}: a busy machine takes longer, "
            "and few samples may mislead"
        )
    if any(estimate.grows for estimate in used):
        yield "+: at least; a search makes more shards until it has enough, and slows down as it goes on"
    size, free = sum(estimate.size for estimate in used), shutil.disk_usage(paths.out).free
    yield f"{byte_size(free)} are free at {paths.out}" + ("" if size < free else ": that is not enough")


def _own_costs(inventory: Inventory, stages: Mapping[str, Stage], name: str) -> Costs | None:
    """Return the cost of the stage in this dataset; None where too little of it is finished."""
    if not all(inventory.complete(read) for read in stages[name].inputs):
        return None
    state = inventory.stage(name)
    costs = costs_of(state, {shard: record.seconds for shard, record in state.records.items()})
    if not state.missing:
        return costs
    return costs if costs.samples and not stages[name].requested_samples(inventory.config) else None


def _estimate(
    inventory: Inventory, stages: Mapping[str, Stage], name: str, costs: Costs, producer: str, short: Config
) -> ResourceEstimate:
    measured = ResourceEstimate(
        stage=name,
        shards=costs.shards + costs.other_shards,
        samples=costs.samples,
        size=costs.samples * costs.bytes_per_sample + costs.bytes_once,
        seconds=costs.samples * costs.seconds_per_sample + costs.seconds_once,
        warm_up=costs.warm_up,
    )
    if inventory.complete(name) or not costs.samples or producer not in upstream(stages, name):
        return measured
    wanted, tried = stages[producer].requested_samples(inventory.config), stages[producer].requested_samples(short)
    if inventory.complete(producer):
        wanted = [record.samples for record in inventory.stage(producer).records.values() if record.samples]
    samples = sum(wanted)
    # Shards without samples take longer in a larger search, but not in later stages.
    once = samples / sum(tried) if name == producer else 1.0
    return ResourceEstimate(
        stage=name,
        shards=len(wanted) + (0 if name == producer else costs.other_shards),
        samples=samples,
        size=samples * costs.bytes_per_sample + once * costs.bytes_once,
        seconds=samples * costs.seconds_per_sample + once * costs.seconds_once,
        warm_up=costs.warm_up,
        grows=name == producer and costs.other_shards > 0,
    )


def _table(estimates: Sequence[ResourceEstimate], workers: int) -> Iterator[str]:
    total = (
        "total",
        f"{sum(estimate.shards for estimate in estimates):,}",
        f"{max(estimate.samples for estimate in estimates):,}",
        byte_size(sum(estimate.size for estimate in estimates)),
        duration_text(sum(estimate.wall(workers) for estimate in estimates)),
    )
    rows = [_HEADER, *(_row(estimate, workers) for estimate in estimates), total]
    widths = [max(len(row[column]) for row in rows) for column in range(len(_HEADER))]
    for name, *cells in rows:
        yield "  ".join([name.ljust(widths[0]), *map(str.rjust, cells, widths[1:])])


def _row(estimate: ResourceEstimate, workers: int) -> tuple[str, ...]:
    shards = f"{estimate.shards:,}{'+' if estimate.grows else ''}"
    time_text = duration_text(estimate.wall(workers))
    return (estimate.stage, shards, f"{estimate.samples:,}", byte_size(estimate.size), time_text)
