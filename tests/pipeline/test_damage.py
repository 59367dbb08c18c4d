"""A flipped byte is found when it is read, named and mended: the run ends with the bytes of an undisturbed one."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from pipeline.config import Config, StrictModel
from pipeline.errors import Fatal
from pipeline.paths import DatasetPaths, file_digest, remove
from pipeline.records import read_record
from pipeline.run import run_stage
from pipeline.stage import Outcome, Shard, Stage, Task
from pipeline.status import status_lines
from tests.pipeline.conftest import WriteConfig, made, record_times
from tests.pipeline.toy_run import STAGES, load, run_toy_stages

WORK = Path(".work/toys")


def flip(path: Path, place: int = 700) -> None:
    """Change one bit in place, as a disk does: no size, no time of a record and no link changes."""
    content = bytearray(path.read_bytes())
    content[place] ^= 1
    with open(path, "r+b") as stream:
        stream.write(content)


def again(before: dict[str, int], out: Path) -> set[str]:
    """The shards whose records were written since `before`."""
    return {name for name, time in record_times(out).items() if before.get(name) != time}


@pytest.mark.parametrize(
    ("workers", "damaged", "edited", "remade"),
    [
        # read by the next stage; and by shards of its own stage, which were made of the good bytes and stay
        (1, ["grain/harvest0-0", "grain/harvest2-1"], {"flour": {"fineness": 3.0}}, ("flour", "bread")),
        # the first is read two stages later; the second is found when the first is rebuilt
        (2, ["flour/harvest1-0", "grain/harvest1-0"], {"salt": {"spoons": 2}}, ("salt", "bread")),
    ],
)
def test_corruption_is_named_and_rebuilt_to_the_same_bytes(
    tmp_path: Path,
    write_config: WriteConfig,
    workers: int,
    damaged: list[str],
    edited: dict[str, object],
    remade: tuple[str, ...],
) -> None:
    out = tmp_path / "out"
    run_toy_stages(write_config(), out, workers=workers)
    before = dict(record_times(out))
    config = write_config(**edited)
    for shard in damaged:
        flip(next((out / WORK).glob(f"{shard}.*")), 3)
    run_toy_stages(config, out, workers=workers)
    log = (out / WORK / "log.txt").read_text(encoding="utf-8")
    for shard in damaged:
        named = next((out / WORK).glob(f"{shard}.*")).relative_to(out / WORK)
        assert f"{named} is corrupted: its sha256 is not the one in its record; {named.stem} is rebuilt" in log
    assert again(before, out) == {*damaged, *(name for name in before if name.startswith(remade))}
    run_toy_stages(config, tmp_path / "calm")
    assert made(out) == made(tmp_path / "calm")


def test_corruption_in_the_running_stage_is_rebuilt(tmp_path: Path, write_config: WriteConfig) -> None:
    out = tmp_path / "out"
    run_toy_stages(write_config(), out, "grain")
    whole, before = made(out), dict(record_times(out))
    flip(out / WORK / "grain/harvest1-0.tar")
    (out / WORK / "grain/harvest2-1.tar").unlink()
    run_toy_stages(write_config(), out, "grain")
    assert again(before, out) == {"grain/harvest1-0", "grain/harvest2-1"}
    assert made(out) == whole


def test_input_rebuilt_with_other_bytes_is_read_again(tmp_path: Path, write_config: WriteConfig) -> None:
    out = tmp_path / "out"
    run_toy_stages(write_config(), out)
    before = dict(record_times(out))
    path = out / WORK / "salt/records/bag-0.json"
    flip(out / WORK / "salt/bag-0.txt", 0)
    path.unlink()
    run_toy_stages(write_config(), out)
    assert again(before, out) == {"salt/bag-0"}, "the same bytes came back"

    record = read_record(path)
    assert record is not None
    flip(out / WORK / "salt/bag-0.txt", 0)
    files = {"bag-0.txt": {"sha256": file_digest(out / WORK / "salt/bag-0.txt"), "bytes": 5}}
    path.write_bytes(replace(record, files=files).to_bytes())
    assert run_toy_stages(write_config(), out)["bread"].made == 6
    assert "6 shards are rebuilt: an input has other bytes" in (out / WORK / "log.txt").read_text(encoding="utf-8")


def test_record_with_a_flipped_byte_has_its_shard_rebuilt(tmp_path: Path, write_config: WriteConfig) -> None:
    out = tmp_path / "out"
    run_toy_stages(write_config(), out)
    whole = made(out)
    path = out / WORK / "grain/records/harvest0-1.json"
    path.write_bytes(path.read_bytes().replace(b'"grains":4', b'"grains":5'))
    assert json.loads(path.read_bytes())["summary"] == {"grains": 5}
    results = run_toy_stages(write_config(), out)
    assert {name: result.made for name, result in results.items()} == {"salt": 0, "grain": 1, "flour": 0, "bread": 0}
    assert made(out) == whole


def write_file(task: Task) -> Outcome:
    with task.output(f"{task.shard.name}.txt") as stream:
        stream.write(b"a" * 1000)
    return Outcome(1)


def rot_and_read(task: Task) -> Outcome:
    path = Path(task.config.path).parent / ".work/toys/first/a.txt"
    flip(path)
    return Outcome(len(task.input("first", "a.txt").read_bytes()))


class Other(StrictModel):
    """Nothing to say."""


def test_disk_that_corrupts_a_rebuilt_shard_stops_everything(tmp_path: Path) -> None:
    stages = {
        "first": Stage("first", __name__, StrictModel, (), lambda _: [Shard("a")], write_file, lambda _: 0),
        "second": Stage(
            "second", __name__, Other, ("first",), lambda _: [Shard("b", {}, ("first/a",))], rot_and_read, lambda _: 0
        ),
    }
    config = Config("toys", "1.0.0", 0, {"first": StrictModel(), "second": Other()}, tmp_path / "toys.yaml")
    run_stage("first", stages, config, DatasetPaths(tmp_path, "toys"), workers=1)
    with pytest.raises(Fatal, match=r"first/a\.txt is corrupted: .*, and a was just rebuilt: disk or memory"):
        run_stage("second", stages, config, DatasetPaths(tmp_path, "toys"), workers=1)


def in_place_of(path: Path, what: str) -> None:
    """Corrupt a file of the engine's own."""
    whole = path.read_bytes()
    path.unlink()
    if what == "a folder":
        (path / "with").mkdir(parents=True)
        (path / "with/a file").write_text("in it", encoding="utf-8")
    else:
        content = {
            "half": whole[:-40],
            "not UTF-8": b'{"checksum": "\xff\xfe"}',
            "a list": b"[]",
            "text": b'"checksum"',
        }
        content |= {"deep": b"[" * 100_000, "long number": b"9" * 10_000, "empty": b""}
        content["other types"] = json.dumps(dict.fromkeys(json.loads(whole), 7)).encode() if whole[:1] == b"{" else b"7"
        path.write_bytes(content[what])


CORRUPTED = ("half", "not UTF-8", "a list", "text", "deep", "long number", "empty", "other types", "a folder")


def test_corrupted_record_has_its_shard_rebuilt(tmp_path: Path, write_config: WriteConfig) -> None:
    out = tmp_path / "out"
    run_toy_stages(write_config(salt={"bags": len(CORRUPTED)}), out, "salt")
    whole = made(out)
    for number, what in enumerate(CORRUPTED):
        in_place_of(out / WORK / f"salt/records/bag-{number}.json", what)
    in_place_of(out / WORK / "salt/engine/manifest.json", "a folder")
    assert run_toy_stages(write_config(salt={"bags": len(CORRUPTED)}), out, "salt")["salt"].made == len(CORRUPTED)
    assert made(out) == whole


def test_corrupted_files_of_the_engine_are_replaced(tmp_path: Path, write_config: WriteConfig) -> None:
    out, config = tmp_path / "out", write_config(salt={"bags": 2})
    run_toy_stages(config, out, "salt")
    whole, stage = made(out), out / WORK / "salt"
    for what in CORRUPTED:
        (stage / "engine/published.json").write_bytes(b"[]")
        (stage / "failed/bag-1.json").write_bytes(b"{}")
        for note in ("engine/manifest.json", "engine/published.json", "failed/bag-1.json"):
            in_place_of(stage / note, what)
        list(status_lines(load(config), STAGES, DatasetPaths(out, "toys"), workers=1))
        run_toy_stages(config, out, "salt")
        remove(stage / "engine/published.json")
        assert made(out) == whole, what
    (stage / "records/bag-1.json").unlink()
    for what in CORRUPTED:
        (stage / "failed/bag-1.json").write_bytes(b"{}")
        in_place_of(stage / "failed/bag-1.json", what)
        lines = list(status_lines(load(config), STAGES, DatasetPaths(out, "toys"), workers=1))
        assert any(line.split()[:3] == ["salt", "1/2", "0"] for line in lines), what
        remove(stage / "failed/bag-1.json")


def test_folder_in_place_of_a_shard_counts_as_corruption(tmp_path: Path, write_config: WriteConfig) -> None:
    out, config = tmp_path / "out", write_config(grain={"fields": 1, "wanted": 8})
    run_toy_stages(config, out, "grain")
    whole = made(out)
    in_place_of(out / WORK / "grain/harvest0-0.tar", "a folder")
    assert run_toy_stages(config, out, "grain")["grain"].made == 1
    assert made(out) == whole


def test_listing_of_a_file_elsewhere_deletes_nothing_there(tmp_path: Path, write_config: WriteConfig) -> None:
    out, outside, small = tmp_path / "out", tmp_path / "precious.txt", {"fields": 1, "wanted": 1}
    run_toy_stages(write_config(grain=small), out)
    outside.write_text("mine", encoding="utf-8")
    (out / WORK / "bread/engine/published.json").write_text('["../precious.txt"]', encoding="utf-8")
    run_toy_stages(write_config(grain=small), out)
    assert outside.read_text(encoding="utf-8") == "mine"
    assert json.loads((out / WORK / "bread/engine/published.json").read_bytes()) == ["toys/loaves/0.bin"]
