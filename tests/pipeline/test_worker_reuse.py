"""Workers of one run: kept from stage to stage, each shard with a record of its own memory."""

from __future__ import annotations

import json
import os
from pathlib import Path

from pipeline.config import Config, StrictModel
from pipeline.paths import DatasetPaths
from pipeline.run import run_stages
from pipeline.stage import Outcome, Shard, Stage, Task


class LoomsConfig(StrictModel):
    """No keys."""


HELD_BYTES = 200_000_000


def write_worker(task: Task) -> Outcome:
    """Write the id of the worker's process; the first stage holds much memory for a moment."""
    held = b"wool" * (HELD_BYTES // 4) if task.shard.inputs == () else b""
    with task.output(f"{task.shard.name}.json") as stream:
        stream.write(json.dumps(os.getpid()).encode())
    return Outcome(len(held) // HELD_BYTES)


def test_workers_are_kept_from_stage_to_stage_and_records_hold_the_memory_of_one_shard(tmp_path: Path) -> None:
    wool = Stage("wool", __name__, LoomsConfig, (), lambda _: [Shard("a")], write_worker, lambda _: 0)
    knit = [Shard("a", inputs=("wool/a",))]
    sock = Stage("sock", __name__, LoomsConfig, ("wool",), lambda _: knit, write_worker, lambda _: 0)
    stages, paths = {"wool": wool, "sock": sock}, DatasetPaths(tmp_path, "toys")
    config = Config("toys", "1.0.0", 0, dict.fromkeys(stages, LoomsConfig()), tmp_path / "toys.yaml")
    held = b"wool" * HELD_BYTES
    run_stages(stages, stages, config, paths, 1)
    assert len(held) == 4 * HELD_BYTES, "more than what a worker needs is held by the process that starts it"
    workers = [(paths.stage(name).root / "a.json").read_text(encoding="utf-8") for name in stages]
    assert workers[0] == workers[1]
    peaks = [json.loads((paths.stage(name).records / "a.json").read_bytes())["peak_bytes"] for name in stages]
    assert peaks[0] > HELD_BYTES
    assert peaks[1] < peaks[0] - HELD_BYTES / 2
