"""`make plan`: what a dataset will take, from a trial of the real stages or from its own records."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.config import Config, StrictModel
from pipeline.errors import ConfigError
from pipeline.estimate import plan_lines
from pipeline.paths import DatasetPaths
from pipeline.run import run_stage
from pipeline.stage import Outcome, Plan, Shard, Stage, Task

BYTES_PER_SAMPLE = 1000


class CornConfig(StrictModel):
    wanted: int = 400


def corn_plan(plan: Plan) -> list[Shard]:
    return [Shard(f"corn-{number}", {"samples": size}) for number, size in enumerate(corn_asked(plan.config))]


def corn_asked(config: Config) -> list[int]:
    wanted = config.section(CornConfig).wanted
    return [min(100, wanted - start) for start in range(0, wanted, 100)]


def flour_plan(plan: Plan) -> list[Shard]:
    sacks = [
        Shard(name, {"samples": (plan.summary("corn", name) or {"samples": 0})["samples"]}, (f"corn/{name}",))
        for name in plan.shards("corn")
        if plan.summary("corn", name)
    ]
    done = sacks and all(plan.summary("flour", sack.name) is not None for sack in sacks)
    return [*sacks, *([Shard("label", {}, ())] if done else [])]


def write_samples(task: Task) -> Outcome:
    samples = int(task.shard.params.get("samples", 0))
    with task.output(f"{task.shard.name}.bin") as stream:
        stream.write(bytes(BYTES_PER_SAMPLE * max(samples, 1)))
    return Outcome(samples, {"samples": samples})


def write_nothing(task: Task) -> Outcome:
    return Outcome(0)


CORN = Stage(
    "corn", __name__, CornConfig, (), corn_plan, write_samples, lambda _: 0,
    requested_samples=corn_asked, trial_config=lambda config: CornConfig(wanted=20),
)  # fmt: skip
FLOUR = Stage("flour", __name__, StrictModel, ("corn",), flour_plan, write_samples, lambda _: 0)
IDLE = Stage("idle", __name__, StrictModel, (), lambda _: [], write_nothing, lambda _: 0)
STAGES = {"idle": IDLE, "corn": CORN, "flour": FLOUR}


def config(wanted: int = 400) -> Config:
    sections = {"idle": StrictModel(), "corn": CornConfig(wanted=wanted), "flour": StrictModel()}
    return Config("toys", "1.0.0", 3, sections, Path("toys.yaml"))


def planned(places: DatasetPaths, asked: Config) -> tuple[dict[str, list[str]], list[str]]:
    """The table's rows by stage, without their times, and the lines about it."""
    lines = list(plan_lines(asked, STAGES, places, workers=2))
    first = next(number for number, line in enumerate(lines) if line.startswith("stage"))
    last = next(number for number, line in enumerate(lines) if line.startswith("total"))
    rows = [line.split() for line in lines[first + 1 : last + 1]]
    return {row[0]: [row[1], row[2], " ".join(row[3:5])] for row in rows}, [*lines[:first], *lines[last + 1 :]]


def test_trial_is_scaled_to_the_requested_samples_and_leaves_no_files(tmp_path: Path) -> None:
    rows, notes = planned(DatasetPaths(tmp_path, "toys"), config())
    assert rows == {
        "corn": ["4", "400", "400.0 kB"],
        "flour": ["5", "400", "401.0 kB"],  # a label is written once, for twenty samples or for 400
        "total": ["9", "400", "801.0 kB"],
    }
    assert notes[0].startswith("running a short trial")
    assert notes[-1].endswith(f"are free at {tmp_path}")
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_finished_stages_are_counted_without_a_trial(tmp_path: Path) -> None:
    places, asked = DatasetPaths(tmp_path, "toys"), config(250)
    for name in STAGES:
        run_stage(name, STAGES, asked, places, workers=1)
    rows, notes = planned(places, asked)
    assert rows["flour"] == ["4", "250", "251.0 kB"]
    assert not any("trial" in note for note in notes)


def test_finished_shards_of_a_stage_predict_the_rest(tmp_path: Path) -> None:
    places, asked = DatasetPaths(tmp_path, "toys"), config(250)
    for name in STAGES:
        run_stage(name, STAGES, asked, places, workers=1)
    for name in ("corn-1", "label"):
        (places.stage("flour").records / f"{name}.json").unlink()
    rows, notes = planned(places, asked)
    assert rows["flour"] == ["3", "250", "250.0 kB"]
    assert not any("trial" in note for note in notes)


def test_failing_trial_is_reported_as_the_failure_of_the_run(tmp_path: Path) -> None:
    def fail(task: Task) -> Outcome:
        raise ValueError("the stones are blunt")

    stages = {**STAGES, "flour": Stage("flour", __name__, StrictModel, ("corn",), flour_plan, fail, lambda _: 0)}
    with pytest.raises(ConfigError, match="the trial of flour failed, as the run would: ValueError: the stones are"):
        list(plan_lines(config(), stages, DatasetPaths(tmp_path, "toys"), workers=2))
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]
