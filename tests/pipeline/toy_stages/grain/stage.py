"""Grain: a plan that grows. Each harvest is planned when the one before is in, as long as enough came in."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from pipeline.config import StrictModel
from pipeline.shards import ShardWriter, array_bytes, bytes_array, read_shard
from pipeline.stage import Outcome, Plan, Shard, Stage, Task


class GrainConfig(StrictModel):
    """How much is harvested."""

    fields: int = Field(2, ge=1, le=100, description="shards a harvest")
    wanted: int = Field(20, ge=1, description="samples after which no more harvest is planned")


def plan(plan: Plan) -> list[Shard]:
    """Harvests of `fields` shards each, until the finished ones hold `wanted` samples."""
    config = plan.config.section(GrainConfig)
    shards: list[Shard] = []
    samples, before = 0, tuple[str, ...]()
    while samples < config.wanted:
        names = [f"harvest{len(shards) // config.fields}-{field}" for field in range(config.fields)]
        shards += [Shard(name, {"field": field}, before) for field, name in enumerate(names)]
        summaries = [plan.summary("grain", name) for name in names]
        if any(summary is None for summary in summaries):
            break
        samples += sum(summary["grains"] for summary in summaries if summary is not None)
        before = tuple(f"grain/{name}" for name in names)
    return shards


def run_shard(task: Task) -> Outcome:
    """Random grains, each larger by the first grain of the harvest before; every third is rejected."""
    rng, seed = task.rng("grains"), np.zeros(100)
    for name in task.shard.inputs:
        _, members = next(read_shard(task.input("grain", f"{name.partition('/')[2]}.tar")))
        seed += bytes_array(members["size.npy"])
    with task.output(f"{task.shard.name}.tar") as stream, ShardWriter(stream) as writer:
        for index in range(6):
            if index % 3 == 2:
                task.reject(f"{task.shard.name}-{index}", "hollow", detail=f"grain {index}")
            else:
                writer.write(f"{task.shard.name}-{index}", {"size.npy": array_bytes(seed + rng.random(100))})
    return Outcome(samples=writer.samples, summary={"grains": writer.samples})


STAGE = Stage("grain", __name__, GrainConfig, (), plan, run_shard, lambda _: 100_000)
