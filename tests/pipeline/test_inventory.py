"""Plans and fingerprints: what makes a shard new, and plans that break their contract."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pipeline.config import Config, StrictModel
from pipeline.inventory import Inventory
from pipeline.paths import DatasetPaths
from pipeline.records import ShardRecord, fingerprint, read_record, recipe
from pipeline.stage import Outcome, Plan, Shard, Stage, Task


class Empty(StrictModel):
    """Nothing to say."""


class Other(StrictModel):
    """Nothing to say either."""


def nothing(task: Task) -> Outcome:
    raise AssertionError("no shard is made here")


def stage(name: str, *shards: Shard, inputs: tuple[str, ...] = (), config: type[StrictModel] = Empty) -> Stage:
    return Stage(name, __name__, config, inputs, lambda _: list(shards), nothing, lambda _: 0)


def inventory(out: Path, *stages: Stage) -> Inventory:
    config = Config("toy", "1.0.0", 0, {stage.name: stage.config() for stage in stages}, Path("toy.yaml"))
    return Inventory(config, {stage.name: stage for stage in stages}, DatasetPaths(out, "toy"))


def prints(out: Path, *stages: Stage) -> dict[str, str]:
    surveyed = inventory(out, *stages)
    return {
        f"{stage.name}/{shard}": value
        for stage in stages
        for shard, value in surveyed.stage(stage.name).fingerprints.items()
    }


FIRST = stage("first", Shard("a", {"size": 1}), Shard("b", {"size": 1}))
SECOND = stage("second", Shard("c", {}, ("first/a",)), Shard("d", {}, ("second/c",)), inputs=("first",))


def test_fingerprint_depends_on_everything_that_bytes_depend_on() -> None:
    shard = Shard("a", {"size": 1})

    def of(stage: str = "s", shard: Shard = shard, code: str = "c", key: int = 1, **other: Any) -> str:
        dataset, inputs = other.get("dataset", ("n", "1.0.0", 0)), other.get("inputs", {"x/y": "0"})
        return fingerprint(recipe(stage, shard, code, {"k": key}, dataset, inputs))

    others = {
        of(stage="z"),
        of(shard=replace(shard, name="b")),
        of(shard=replace(shard, params={"size": 2})),
        of(code="d"),
        of(key=2),
        of(dataset=("m", "1.0.0", 0)),
        of(dataset=("n", "1.0.1", 0)),
        of(dataset=("n", "1.0.0", 1)),
        of(inputs={"x/y": "1"}),
        of(inputs={"x/z": "0"}),
    }
    assert len(others | {of()}) == 11
    assert of() == of()


def test_changed_shard_changes_only_its_readers(tmp_path: Path) -> None:
    before = prints(tmp_path, FIRST, SECOND)
    changed = stage("first", Shard("a", {"size": 2}), Shard("b", {"size": 1}))
    after = prints(tmp_path, changed, SECOND)
    assert {name for name in before if before[name] != after[name]} == {"first/a", "second/c", "second/d"}


def test_unread_record_of_an_own_shard_keeps_its_reader_waiting(tmp_path: Path) -> None:
    surveyed = inventory(tmp_path, FIRST, SECOND).stage("second")
    assert [surveyed.ready(shard) for shard in surveyed.shards] == [True, False]


@pytest.mark.parametrize(
    ("shards", "message"),
    [
        ((Shard("a"), Shard("a")), "malformed or duplicate"),
        ((Shard("a.b"),), "malformed or duplicate"),
        ((Shard(""),), "malformed or duplicate"),
        ((Shard("a", {}, ("first/none",)),), "first/none, which is not planned earlier"),
        ((Shard("a", {}, ("second/b",)), Shard("b")), "second/b, which is not planned earlier"),
        ((Shard("a", {}, ("third/x",)),), "third is no input of second"),
    ],
)
def test_plan_that_breaks_its_contract_is_refused(tmp_path: Path, shards: tuple[Shard, ...], message: str) -> None:
    surveyed = inventory(tmp_path, FIRST, stage("third", Shard("x")), stage("second", *shards, inputs=("first",)))
    with pytest.raises(ValueError, match=message):
        surveyed.stage("second")


def test_plan_sees_only_the_stages_and_sections_that_it_reads(tmp_path: Path) -> None:
    seen: list[Plan] = []

    def plan(plan: Plan) -> list[Shard]:
        seen.append(plan)
        return []

    second = replace(stage("second", inputs=("first",)), plan=plan)
    inventory(tmp_path, FIRST, second, stage("third", config=Other)).stage("second")
    assert seen[0].shards("first") == ["a", "b"]
    assert set(seen[0].config.sections) == {"first", "second"}
    with pytest.raises(ValueError, match="stage third, which is not among its inputs"):
        seen[0].shards("third")


def test_record_survives_writing_and_reading(tmp_path: Path) -> None:
    record = ShardRecord(
        "s",
        "a",
        "f" * 64,
        {"code": "c"},
        {"r/b.tar": "1"},
        {"a.tar": {"sha256": "0", "bytes": 3}},
        2,
        {"odd": 1},
        0.5,
        9,
        {"k": [1]},
    )
    (tmp_path / "a.json").write_bytes(record.to_bytes())
    assert read_record(tmp_path / "a.json") == record
    assert read_record(tmp_path / "none.json") is None


def test_record_with_a_flipped_byte_is_ignored(tmp_path: Path) -> None:
    record = ShardRecord("s", "a", "f" * 64, {}, {}, {"a.tar": {"sha256": "0", "bytes": 3}}, 2, {}, 0.5, 9, {"k": 10})
    path, content = tmp_path / "a.json", record.to_bytes()
    for place in range(len(content) - 1):
        path.write_bytes(content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :])
        assert read_record(path) is None
