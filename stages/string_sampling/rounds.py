"""The rounds of a model: lanes that draw beside each other, and a pool that has each graph once."""

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
    """The rounds of one model as far as they are known. pools: summaries of the finished ones; ended: why there is no
    other round, empty where there is one."""

    shards: tuple[Shard, ...]
    lanes: tuple[str, ...]
    pools: tuple[Mapping[str, Any], ...]
    ended: str


def model_rounds(plan: Plan, number: int, source: SourceConfig) -> ModelRounds:
    """The rounds of a model: another one until there are as many shapes as wanted, or `patience` of them in a row were
    in vain, or there were `rounds`. Raises ConfigError where the model is not there."""
    config = plan.config.section(StringSamplingConfig)
    begun = source_shard(plan, number, source)
    shards = [begun]
    lanes: list[str] = []
    pools: list[Mapping[str, Any]] = []
    how = config.model_dump(mode="json", include={"known", "tries", "upright", "require", "draws"})
    how["sources"] = [{**source.model_dump(mode="json"), "samples": 1}]  # how many are wanted is no lane's business
    kit = f"exemplars/{source.kit}"
    for place in range(config.rounds):
        before = [f"s{number:02}-r{each:03}-pool" for each in range(place)]
        names = [f"s{number:02}-r{place:03}-lane{lane:02}" for lane in range(config.lanes)]
        params = {"job": "lane", "settings": how, "from": begun.name, "before": before}
        inputs = (kit, f"string_sampling/{begun.name}", *(f"string_sampling/{each}" for each in before))
        shards += [Shard(name, params, inputs) for name in names]
        lanes += names
        last = f"s{number:02}-r{place:03}-pool"
        pooled = {"job": "pool", "lanes": names, "before": before}
        shards.append(Shard(last, pooled, tuple(f"string_sampling/{each}" for each in (*names, *before))))
        summary = plan.summary("string_sampling", last)
        if summary is None:
            return ModelRounds(tuple(shards), tuple(lanes), tuple(pools), "")
        pools.append(summary)
        ended = _ended(source.samples, config.patience, pools)
        if ended:
            return ModelRounds(tuple(shards), tuple(lanes), tuple(pools), ended)
    return ModelRounds(tuple(shards), tuple(lanes), tuple(pools), f"{config.rounds} rounds are over")


def _ended(wanted: int, patience: int, pools: Sequence[Mapping[str, Any]]) -> str:
    if sum(each["new"] for each in pools) >= wanted:
        return "as many as wanted"
    if len(pools) >= patience and not any(each["new"] for each in pools[-patience:]):
        return f"{patience} rounds brought nothing new"
    return ""


def run_pool(task: Task) -> Outcome:
    """Files of the shard: `.graphs.txt`, digests of the graphs that the lanes of a round have found and that no round
    before had, each once; `.jsonl`, for each its lane, its key there and its graph."""
    params, name = task.shard.params, task.shard.name
    seen = {
        each
        for pool in params["before"]
        for each in task.input("string_sampling", f"{pool}.graphs.txt").read_text().split()
    }
    rows: list[dict[str, Any]] = []
    for lane in params["lanes"]:
        for sample in read_samples(task.input("string_sampling", f"{lane}.tar")):
            if sample.graph in seen:
                task.reject(sample.key, "duplicate")
                continue
            seen.add(sample.graph)
            rows.append({"lane": lane, "key": sample.key, "graph": sample.graph})
    with task.output(f"{name}.graphs.txt") as stream:
        stream.write("".join(f"{row['graph']}\n" for row in rows).encode())
    with task.output(f"{name}.jsonl") as stream:
        stream.writelines(json_bytes(row) for row in rows)
    return Outcome(0, {"new": len(rows)})


def read_pool(task: Task, pool: str) -> list[dict[str, Any]]:
    """What `run_pool` wrote in `pool`, one of the inputs."""
    return [json.loads(line) for line in task.input("string_sampling", f"{pool}.jsonl").read_bytes().splitlines()]
