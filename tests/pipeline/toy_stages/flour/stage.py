"""Flour: one shard for each of grain, and every kind of trouble that a shard can have."""

from __future__ import annotations

import errno
import os
import signal
import time
from pathlib import Path
from typing import Literal

from pydantic import Field

from pipeline.config import StrictModel
from pipeline.errors import Rejected, ShardFailed
from pipeline.shards import ShardWriter, array_bytes, bytes_array, read_shard
from pipeline.stage import Outcome, Plan, Shard, Stage, Task

Trouble = Literal["dies", "dies once", "fails", "fails once", "refuses", "no space", "big", "sleeps", "stops once"]


class FlourConfig(StrictModel):
    """How fine the flour is, and what goes wrong."""

    fineness: float = Field(2.0, gt=0, le=10, description="divisor of each grain")
    seconds: float = Field(0.0, ge=0, description="time that each sample takes; unit: seconds")
    trouble: dict[str, Trouble] = Field(default_factory=dict, description="what goes wrong in a shard, by its name")
    marks: Path = Field(Path("marks"), description="folder where a trouble that comes once notes that it came")


def plan(plan: Plan) -> list[Shard]:
    """One shard for each of grain, of its name."""
    return [Shard(name, {"samples": 4}, (f"grain/{name}",)) for name in plan.shards("grain")]


def run_shard(task: Task) -> Outcome:
    """Each sample of grain, divided, with random noise of its own."""
    config = task.config.section(FlourConfig)
    with task.output(f"{task.shard.name}.tar") as stream, ShardWriter(stream) as writer:
        for key, members in read_shard(task.input("grain", f"{task.shard.name}.tar")):
            time.sleep(config.seconds)
            ground = bytes_array(members["size.npy"]) / config.fineness + task.rng(key).random(100)
            writer.write(key, {"dust.npy": array_bytes(ground)})
            task.progress(writer.samples, 4)
        _meet(config, task)
    return Outcome(samples=writer.samples)


def _meet(config: FlourConfig, task: Task) -> None:
    trouble = config.trouble.get(task.shard.name)
    if trouble is None:
        return
    config.marks.mkdir(exist_ok=True)
    with open(config.marks / task.shard.name, "a", encoding="utf-8") as marks:
        marks.write("x")
    first = (config.marks / task.shard.name).stat().st_size == 1
    if trouble == "dies" or (trouble == "dies once" and first):
        os.kill(os.getpid(), signal.SIGKILL)
    if trouble == "sleeps":
        time.sleep(10_000)
    if trouble == "stops once" and first:
        os.kill(os.getpid(), signal.SIGSTOP)
    if trouble == "fails" or (trouble == "fails once" and first):
        raise ShardFailed("the stones are blunt")
    if trouble == "refuses":
        raise Rejected("stones in the grain")
    if trouble == "no space":
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    if trouble == "big":
        with task.output(f"{task.shard.name}.big") as stream:
            for _ in range(64):
                stream.write(b"\0" * 1_000_000)


STAGE = Stage("flour", __name__, FlourConfig, ("grain",), plan, run_shard, lambda _: 100_000)
