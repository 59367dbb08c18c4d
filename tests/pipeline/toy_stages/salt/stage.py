"""Salt: a stage that reads nothing and has a size, to see what a change elsewhere leaves alone."""

from __future__ import annotations

from pydantic import Field

from pipeline.config import StrictModel
from pipeline.stage import Outcome, Plan, Shard, Stage, Task


class SaltConfig(StrictModel):
    """How much salt."""

    spoons: int = Field(1, ge=1, le=1_000_000, description="salt in each bag; the disk is told 1 GB a spoon")
    bags: int = Field(1, ge=1, le=10_000, description="shards")


def plan(plan: Plan) -> list[Shard]:
    """One shard a bag."""
    return [Shard(f"bag-{index}", {"samples": 1}) for index in range(plan.config.section(SaltConfig).bags)]


def run_shard(task: Task) -> Outcome:
    """As much salt as there are spoons."""
    with task.output(f"{task.shard.name}.txt") as stream:
        stream.write(b"salt " * task.config.section(SaltConfig).spoons)
    return Outcome(samples=1)


def estimate_bytes(plan: Plan) -> int:
    """Far more than it takes, so that a disk can be too small for it."""
    return plan.config.section(SaltConfig).spoons * 1_000_000_000


STAGE = Stage("salt", __name__, SaltConfig, (), plan, run_shard, estimate_bytes)
