"""The rounds of a model: parallel search workers, and a pool that has each graph once."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pipeline.shards import json_bytes
from pipeline.stage import Outcome, Plan, Shard, Task
from stages.shape.sample import read_samples
from stages.string_sampling.settings import SourceConfig, StringSamplingConfig
from stages.string_sampling.source import source_shard


@dataclass(frozen=True)
class ModelRounds:
    """The rounds of one model, as far as they are known."""

    shards: tuple[Shard, ...]
    workers: tuple[str, ...]
    """Shards of the search workers."""
    pools: tuple[Mapping[str, Any], ...]
    """Summaries of the finished pools."""
    ended: str
    """Why there is no further round; empty if there is one."""


def model_rounds(plan: Plan, number: int, source: SourceConfig) -> ModelRounds:
    """Plan the rounds of a model, until it has enough shapes, `patience` rounds without a new one, or `max_rounds`.

    Raises ConfigError if the model is missing.
    """
    config = plan.config.section(StringSamplingConfig)
    brought = source_shard(plan, number, source)
    shards = [brought]
    workers: list[str] = []
    pools: list[Mapping[str, Any]] = []
    settings = config.model_dump(mode="json", include={"duplicates", "max_placements", "upright", "require", "draws"})
    settings["sources"] = [{**source.model_dump(mode="json"), "samples": 1}]  # workers do not depend on their number
    kit = f"exemplars/{source.kit}"
    for index in range(config.max_rounds):
        before = [f"s{number:02}-r{earlier:03}-pool" for earlier in range(index)]
        names = [f"s{number:02}-r{index:03}-worker{worker:02}" for worker in range(config.parallel_searches)]
        params = {"job": "worker", "settings": settings, "from": brought.name, "before": before}
        inputs = (kit, f"string_sampling/{brought.name}", *_inputs(before))
        shards += [Shard(name, params, inputs) for name in names]
        workers += names
        last = f"s{number:02}-r{index:03}-pool"
        shards.append(Shard(last, {"job": "pool", "workers": names, "before": before}, _inputs([*names, *before])))
        summary = plan.summary("string_sampling", last)
        if summary is None:
            return ModelRounds(tuple(shards), tuple(workers), tuple(pools), "")
        pools.append(summary)
        ended = _reason_to_end(source.samples, config.patience, pools)
        if ended:
            return ModelRounds(tuple(shards), tuple(workers), tuple(pools), ended)
    return ModelRounds(tuple(shards), tuple(workers), tuple(pools), f"{config.max_rounds} rounds are over")


def _inputs(shards: Sequence[str]) -> tuple[str, ...]:
    return tuple(f"string_sampling/{shard}" for shard in shards)


def _reason_to_end(wanted: int, patience: int, pools: Sequence[Mapping[str, Any]]) -> str:
    if sum(pool["new"] for pool in pools) >= wanted:
        return "all shapes found"
    if len(pools) >= patience and not any(pool["new"] for pool in pools[-patience:]):
        return f"{patience} rounds without a new shape"
    return ""


def write_new_graphs(task: Task) -> Outcome:
    """Write the new graphs of a round, each once.

    `.graphs.txt`: their digests; `.jsonl`: for each its worker, its key there, and its graph.
    """
    params, name = task.shard.params, task.shard.name
    seen = {digest for pool in params["before"] for digest in pool_graphs(task, pool)}
    rows: list[dict[str, Any]] = []
    for worker in params["workers"]:
        for sample in read_samples(task.input("string_sampling", f"{worker}.tar")):
            if sample.graph in seen:
                task.reject(sample.key, "duplicate")
                continue
            seen.add(sample.graph)
            rows.append({"worker": worker, "key": sample.key, "graph": sample.graph})
    with task.output(f"{name}.graphs.txt") as stream:
        stream.write("".join(f"{row['graph']}\n" for row in rows).encode())
    with task.output(f"{name}.jsonl") as stream:
        stream.writelines(json_bytes(row) for row in rows)
    return Outcome(0, {"new": len(rows)})


def read_pool(task: Task, pool: str) -> list[dict[str, Any]]:
    """Read the rows of a pool, one of the inputs."""
    return [json.loads(line) for line in task.input("string_sampling", f"{pool}.jsonl").read_bytes().splitlines()]


def pool_graphs(task: Task, pool: str) -> list[str]:
    """Read the digests of the graphs in a pool, one of the inputs."""
    return task.input("string_sampling", f"{pool}.graphs.txt").read_text(encoding="utf-8").split()
