"""Bread: puts flour and salt together and publishes the loaves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pydantic import Field

from pipeline.config import StrictModel
from pipeline.shards import read_shard
from pipeline.stage import Outcome, Plan, Shard, Stage, Task


class BreadConfig(StrictModel):
    """How the bread is baked."""

    loaves: int = Field(4, ge=1, description="how many loaves go on sale")


def plan(plan: Plan) -> list[Shard]:
    """A loaf for each shard of flour."""
    salt = tuple(f"salt/{name}" for name in plan.shards("salt"))
    return [Shard(f"loaf-{name}", {}, (f"flour/{name}", *salt)) for name in plan.shards("flour")]


def run_shard(task: Task) -> Outcome:
    """Flour, then salt."""
    with task.output(f"{task.shard.name}.bin") as stream:
        for _, members in read_shard(task.input("flour", f"{task.shard.name.removeprefix('loaf-')}.tar")):
            stream.write(members["dust.npy"])
        stream.write(task.input("salt", "bag-0.txt").read_bytes())
    return Outcome(samples=1)


def report(plan: Plan) -> Sequence[str]:
    """One line."""
    return [f"{len(plan.shards('bread'))} loaves, all brown"]


def publish(plan: Plan) -> Mapping[str, str]:
    """The first loaves, by number."""
    loaves = plan.shards("bread")[: plan.config.section(BreadConfig).loaves]
    return {f"{plan.config.name}/loaves/{index}.bin": f"{name}.bin" for index, name in enumerate(loaves)}


STAGE = Stage(
    "bread",
    __name__,
    BreadConfig,
    ("flour", "salt"),
    plan,
    run_shard,
    lambda _: 100_000,
    report=report,
    publish=publish,
)
