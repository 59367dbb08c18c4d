"""A run makes what is missing, and the same bytes whoever makes them."""

from __future__ import annotations

import itertools
import json
import time
from pathlib import Path
from typing import Any

import pytest

from pipeline.config import Config, StrictModel
from pipeline.errors import ConfigError
from pipeline.integrity import corrupted_shards
from pipeline.paths import DatasetPaths
from pipeline.run import run_stage
from pipeline.slices import Slice
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from tests.pipeline.conftest import WriteConfig, made, record_times
from tests.pipeline.toy_run import run_toy_stages

WORK = Path(".work/toys")


def test_one_and_two_workers_make_the_same_bytes(tmp_path: Path, write_config: WriteConfig) -> None:
    config = write_config()
    run_toy_stages(config, tmp_path / "one", workers=1)
    run_toy_stages(config, tmp_path / "two", workers=2)
    assert len(made(tmp_path / "one")) > 30
    assert made(tmp_path / "one") == made(tmp_path / "two")


def test_another_seed_makes_other_bytes(tmp_path: Path, write_config: WriteConfig) -> None:
    run_toy_stages(write_config(), tmp_path / "three", "grain")
    run_toy_stages(write_config(seed=4), tmp_path / "four", "grain")
    first, second = (tmp_path / out / WORK / "grain/harvest0-0.tar" for out in ("three", "four"))
    assert first.read_bytes() != second.read_bytes()


def test_shards_of_one_stage_draw_different_numbers(tmp_path: Path, write_config: WriteConfig) -> None:
    run_toy_stages(write_config(), tmp_path / "out", "grain")
    tars = [path.read_bytes() for path in (tmp_path / "out" / WORK / "grain").glob("*.tar")]
    assert len({tar[512:] for tar in tars}) == len(tars) == 6


def test_plan_grows_until_enough_is_made_and_no_further(tmp_path: Path, write_config: WriteConfig) -> None:
    # Four good grains a shard, two shards a harvest: 20 are reached with the third harvest.
    result = run_toy_stages(write_config(grain={"wanted": 20}), tmp_path / "out", "grain")["grain"]
    assert result.made == 6
    names = sorted(path.name for path in (tmp_path / "out" / WORK / "grain").glob("*.tar"))
    assert names == [f"harvest{harvest}-{field}.tar" for harvest in range(3) for field in range(2)]


def test_second_run_makes_nothing_and_touches_nothing(tmp_path: Path, write_config: WriteConfig) -> None:
    config = write_config()
    run_toy_stages(config, tmp_path / "out")
    times = record_times(tmp_path / "out")
    results = run_toy_stages(config, tmp_path / "out")
    assert [result.made for result in results.values()] == [0, 0, 0, 0]
    assert record_times(tmp_path / "out") == times


def test_rejects_are_counted_by_reason_and_listed(tmp_path: Path, write_config: WriteConfig) -> None:
    run_toy_stages(write_config(), tmp_path / "out", "grain")
    grain = tmp_path / "out" / WORK / "grain"
    record = json.loads((grain / "records/harvest0-1.json").read_bytes())
    assert record["rejects"] == {"hollow": 2}
    assert record["samples"] == 4
    lines = [json.loads(line) for line in (grain / "rejects/harvest0-1.jsonl").read_text(encoding="utf-8").splitlines()]
    assert [line["item"] for line in lines] == ["harvest0-1-2", "harvest0-1-5"]
    assert lines[0] == {"item": "harvest0-1-2", "reason": "hollow", "detail": "grain 2", "count": 1}
    assert json.loads((grain / "engine/manifest.json").read_bytes())["rejects"] == {"hollow": 12}


def test_config_edit_rebuilds_the_stages_that_read_it_and_nothing_else(
    tmp_path: Path, write_config: WriteConfig
) -> None:
    run_toy_stages(write_config(), tmp_path / "out")
    before = record_times(tmp_path / "out")
    results = run_toy_stages(write_config(flour={"fineness": 3.0}), tmp_path / "out")
    assert {name: result.made for name, result in results.items()} == {"salt": 0, "grain": 0, "flour": 6, "bread": 6}
    after = record_times(tmp_path / "out")
    assert {name for name in before if before[name] == after[name]} == {
        name for name in before if name.startswith(("grain/", "salt/"))
    }


def test_edited_config_gives_the_bytes_of_a_fresh_run(tmp_path: Path, write_config: WriteConfig) -> None:
    run_toy_stages(write_config(), tmp_path / "edited")
    edited = write_config(grain={"wanted": 10}, flour={"fineness": 3.0})
    run_toy_stages(edited, tmp_path / "edited")
    run_toy_stages(edited, tmp_path / "fresh")
    assert made(tmp_path / "edited") == made(tmp_path / "fresh")


def test_edit_and_edit_back_gives_the_first_bytes_again(tmp_path: Path, write_config: WriteConfig) -> None:
    run_toy_stages(write_config(), tmp_path / "out")
    first = made(tmp_path / "out")
    run_toy_stages(write_config(salt={"spoons": 2}), tmp_path / "out")
    assert made(tmp_path / "out") != first
    run_toy_stages(write_config(), tmp_path / "out")
    assert made(tmp_path / "out") == first


def test_shards_no_longer_planned_are_removed(tmp_path: Path, write_config: WriteConfig) -> None:
    run_toy_stages(write_config(salt={"bags": 3}), tmp_path / "out", "salt")
    run_toy_stages(write_config(salt={"bags": 1}), tmp_path / "out", "salt")
    salt = tmp_path / "out" / WORK / "salt"
    assert [path.name for path in salt.glob("*.txt")] == ["bag-0.txt"]
    assert [path.name for path in (salt / "records").iterdir()] == ["bag-0.json"]


def test_missing_or_shortened_file_is_rebuilt(tmp_path: Path, write_config: WriteConfig) -> None:
    config = write_config()
    run_toy_stages(config, tmp_path / "out", "grain")
    whole = made(tmp_path / "out")
    grain = tmp_path / "out" / WORK / "grain"
    (grain / "harvest0-0.tar").unlink()
    (grain / "harvest2-1.tar").write_bytes(b"short")
    assert run_toy_stages(config, tmp_path / "out", "grain")["grain"].made == 2
    assert made(tmp_path / "out") == whole


def test_unreadable_record_is_ignored(tmp_path: Path, write_config: WriteConfig) -> None:
    config = write_config()
    run_toy_stages(config, tmp_path / "out", "grain")
    record = tmp_path / "out" / WORK / "grain/records/harvest0-0.json"
    record.write_bytes(record.read_bytes()[:40])
    assert run_toy_stages(config, tmp_path / "out", "grain")["grain"].made == 1


def test_half_written_files_are_removed(tmp_path: Path, write_config: WriteConfig) -> None:
    config = write_config()
    run_toy_stages(config, tmp_path / "out", "grain")
    whole = made(tmp_path / "out")
    grain = tmp_path / "out" / WORK / "grain"
    (grain / ".harvest0-0.tar.tmp").write_bytes(b"half")
    (grain / "records/.harvest9-9.json.tmp").write_bytes(b"half")
    (grain / "progress/harvest0-0").write_text("1 6", encoding="utf-8")
    run_toy_stages(config, tmp_path / "out", "grain")
    assert made(tmp_path / "out") == whole


def test_stage_does_not_start_before_the_stages_it_reads_are_done(tmp_path: Path, write_config: WriteConfig) -> None:
    config = write_config()
    run_toy_stages(config, tmp_path / "out", "salt")
    with pytest.raises(ConfigError, match=r"bread reads grain, and 2 of its 2 .* harvest0-0.* run stage grain first"):
        run_toy_stages(config, tmp_path / "out", "bread")


def test_shards_that_read_nothing_of_other_stages_do_not_wait_for_them(tmp_path: Path) -> None:
    def make(task: Task) -> Outcome:
        return Outcome(1)

    dough = Stage("dough", __name__, LoomsConfig, (), lambda _: [Shard("rye")], make, lambda _: 0)
    shards = [Shard("loaf", inputs=("dough/rye",)), Shard("stone")]
    oven = Stage(
        "oven",
        __name__,
        LoomsConfig,
        ("dough",),
        lambda _: shards,
        make,
        lambda _: 0,
        uses_input=lambda _, only: only != "stone",
    )
    stages, places = {"dough": dough, "oven": oven}, DatasetPaths(tmp_path, "toys")
    config = Config("toys", "1.0.0", 3, {"dough": LoomsConfig(), "oven": LoomsConfig()}, tmp_path / "toys.yaml")
    with pytest.raises(ConfigError, match="run stage dough first"):
        run_stage("oven", stages, config, places, 1)
    assert run_stage("oven", stages, config, places, 1, only="stone").made == 1


def test_disk_too_small_is_reported_before_the_start(tmp_path: Path, write_config: WriteConfig) -> None:
    with pytest.raises(ConfigError, match=r"salt needs about 900\.0 TB .* per sample.*are free"):
        run_toy_stages(write_config(salt={"spoons": 900_000}), tmp_path / "out", "salt")
    assert not list((tmp_path / "out" / WORK / "salt").glob("*.txt"))


def test_parts_of_a_job_array_together_make_the_whole(tmp_path: Path, write_config: WriteConfig) -> None:
    config = write_config(salt={"bags": 5})
    run_toy_stages(config, tmp_path / "whole", "salt")
    first = run_toy_stages(config, tmp_path / "parts", "salt", part=Slice(1, 2))["salt"]
    assert (first.made, first.left) == (3, 2)
    salt = tmp_path / "parts" / WORK / "salt"
    assert not (salt / "engine/manifest.json").exists()
    second = run_toy_stages(config, tmp_path / "parts", "salt", part=Slice(2, 2))["salt"]
    assert (second.made, second.left) == (2, 0)
    assert made(tmp_path / "parts") == made(tmp_path / "whole")


def write_nothing(task: Task) -> Outcome:
    return Outcome(0)


def test_plan_that_changes_every_time_is_refused(tmp_path: Path) -> None:
    ticks = itertools.count()
    restless = Stage(
        "restless", __name__, StrictModel, (), lambda _: [Shard("a", {"tick": next(ticks)})], write_nothing, lambda _: 0
    )
    config = Config("toys", "1.0.0", 0, {"restless": StrictModel()}, tmp_path / "toys.yaml")
    with pytest.raises(ValueError, match="shard a was just made, and its plan has changed since"):
        run_stage("restless", {"restless": restless}, config, DatasetPaths(tmp_path, "toys"), workers=1)


def test_published_files_follow_the_config(tmp_path: Path, write_config: WriteConfig) -> None:
    run_toy_stages(write_config(), tmp_path / "out")
    loaves = tmp_path / "out/toys/loaves"
    assert sorted(path.name for path in loaves.iterdir()) == ["0.bin", "1.bin", "2.bin", "3.bin"]
    assert loaves.joinpath("1.bin").samefile(tmp_path / "out" / WORK / "bread/loaf-harvest0-1.bin")
    (loaves / "mine.txt").write_text("a user's own", encoding="utf-8")
    run_toy_stages(write_config(bread={"loaves": 2}), tmp_path / "out")
    assert sorted(path.name for path in loaves.iterdir()) == ["0.bin", "1.bin", "mine.txt"]


def test_published_file_that_went_missing_is_put_back(tmp_path: Path, write_config: WriteConfig) -> None:
    config = write_config()
    run_toy_stages(config, tmp_path / "out")
    whole = made(tmp_path / "out")
    (tmp_path / "out/toys/loaves/0.bin").unlink()
    run_toy_stages(config, tmp_path / "out", "bread")
    assert made(tmp_path / "out") == whole


def write_span(task: Task) -> Outcome:
    """Writes when it began and when it ended."""
    began = time.monotonic()
    time.sleep(0.2)
    with task.output(f"{task.shard.name}.json") as stream:
        stream.write(json.dumps([began, time.monotonic()]).encode())
    return Outcome(0)


def stage_of(shards: list[Shard], **more: Any) -> dict[str, Stage]:
    return {"looms": Stage("looms", __name__, LoomsConfig, (), lambda _: shards, write_span, lambda _: 0, **more)}


def weave(folder: Path, stages: dict[str, Stage], workers: int = 1, only: str = "", **section: str) -> int:
    return run_stage("looms", stages, woven(folder, **section), DatasetPaths(folder, "toys"), workers, only=only).made


def woven(folder: Path, **section: str) -> Config:
    return Config("toys", "1.0.0", 0, {"looms": LoomsConfig(**section)}, folder / "toys.yaml")


class LoomsConfig(StrictModel):
    """Which colour is woven."""

    colour: str = "red"


def test_shard_with_all_threads_runs_alone(tmp_path: Path) -> None:
    threads = {"a": 1, "b": 2, "c": 1, "d": 1, "e": 9}
    weave(tmp_path, stage_of([Shard(name, threads=count) for name, count in threads.items()]), workers=2)
    spans = {name: json.loads((tmp_path / WORK / f"looms/{name}.json").read_text(encoding="utf-8")) for name in threads}
    for wide in ("b", "e"):
        began, ended = spans[wide]
        assert all(span[1] <= began or ended <= span[0] for name, span in spans.items() if name != wide)


def test_only_makes_the_named_shards_and_their_inputs(tmp_path: Path) -> None:
    shards = [Shard("wool"), Shard("sock-0", inputs=("looms/wool",)), Shard("sock-1", inputs=("looms/sock-0",))]
    stages = stage_of([*shards, Shard("sock2"), Shard("hat")])
    assert weave(tmp_path, stages, only="sock") == 3
    assert not (tmp_path / WORK / "looms/engine/manifest.json").exists()
    with pytest.raises(ConfigError, match=r"looms has no shards so or so-\.\.\.; it has wool, sock-0"):
        weave(tmp_path, stages, only="so")
    assert weave(tmp_path, stages) == 2


def test_stage_may_publish_complete_results_before_all_shards_are_made(tmp_path: Path) -> None:
    def whole(plan: Plan) -> dict[str, str]:
        return {f"woven/{name}": f"{name}.json" for name in ("a", "b") if plan.summary("looms", name) is not None}

    stages = stage_of([Shard("a"), Shard("b")], publish=whole, publishes_incomplete=True)
    weave(tmp_path, stages, only="a")
    assert [path.name for path in (tmp_path / "woven").iterdir()] == ["a"]
    places = DatasetPaths(tmp_path, "toys")
    assert list(corrupted_shards(woven(tmp_path), stages, places)) == [], "what nobody has asked for is no damage"
    (tmp_path / "woven/a").unlink()
    (altered,) = corrupted_shards(woven(tmp_path), stages, places)
    assert altered == f"looms: {tmp_path}/woven/a is not what the stage made"
    weave(tmp_path, stages)
    assert sorted(path.name for path in (tmp_path / "woven").iterdir()) == ["a", "b"]


def test_shards_without_their_section_are_not_rebuilt_for_it(tmp_path: Path) -> None:
    stages = stage_of([Shard("a", {"dye": "red"})], whole_section=False)
    assert weave(tmp_path, stages) == 1
    assert weave(tmp_path, stages, colour="blue") == 0
    assert weave(tmp_path, stage_of([Shard("a", {"dye": "blue"})], whole_section=False), colour="blue") == 1
    # A stage whose shards see its section rebuilds them.
    assert weave(tmp_path / "seen", stage_of([Shard("a")])) == 1
    assert weave(tmp_path / "seen", stage_of([Shard("a")]), colour="blue") == 1
