"""`keep: dataset` prunes intermediate files at the end, and rebuilds them on demand."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from pipeline.integrity import corrupted_shards
from pipeline.inventory import Inventory
from pipeline.paths import DatasetPaths
from pipeline.status import status_lines
from tests.pipeline.conftest import WriteConfig, made, record_times
from tests.pipeline.toy_run import STAGES, load, run_toy_stages

WORK = Path(".work/toys")
LAST = "bread"


def between(out: Path) -> list[Path]:
    """The files of shards of all stages but the last, that nobody publishes."""
    return [path for stage in STAGES if stage != LAST for path in (out / WORK / stage).glob("harvest*")]


def finished(out: Path) -> dict[str, bytes]:
    """What users see."""
    return {path: content for path, content in made(out).items() if not path.startswith(".work")}


def test_the_dataset_is_the_same_and_another_run_finds_nothing_to_do(tmp_path: Path, write_config: WriteConfig) -> None:
    run_toy_stages(write_config(), tmp_path / "all")
    config, out = write_config(keep="dataset"), tmp_path / "out"
    run_toy_stages(config, out)
    assert between(tmp_path / "all")
    assert not between(out)
    assert finished(out) == finished(tmp_path / "all")
    before = made(out)
    assert all(not result.made for result in run_toy_stages(config, out).values())
    assert made(out) == before


def test_verify_accepts_a_pruned_dataset_and_status_counts_existing_files(
    tmp_path: Path, write_config: WriteConfig
) -> None:
    config, out = write_config(keep="dataset"), tmp_path / "out"
    run_toy_stages(config, out)
    loaded = load(config)
    assert not list(corrupted_shards(loaded, STAGES, DatasetPaths(out, loaded.name)))
    rows = {line.split()[0]: line.split() for line in status_lines(loaded, STAGES, DatasetPaths(out, loaded.name), 1)}
    assert rows["grain"][-2:] == ["0", "B"]
    assert rows["grain"][1].split("/")[0] == rows["grain"][1].split("/")[1] != "0"


@pytest.mark.parametrize("workers", [1, 2])
def test_pruned_files_are_rebuilt_on_demand_and_pruned_again(
    tmp_path: Path, write_config: WriteConfig, workers: int
) -> None:
    edited = {"salt": {"spoons": 2}}
    run_toy_stages(write_config(**edited), tmp_path / "all")
    out = tmp_path / "out"
    run_toy_stages(write_config(keep="dataset"), out)
    before = dict(record_times(out))
    run_toy_stages(write_config(keep="dataset", **edited), out, workers=workers)
    assert finished(out) == finished(tmp_path / "all")
    assert not between(out)
    again = {name.partition("/")[0] for name, at in record_times(out).items() if before[name] != at}
    assert {"salt", "bread", "flour", "grain"} <= again
    assert "was pruned" in (out / WORK / "log.txt").read_text(encoding="utf-8")


def test_keep_all_rebuilds_pruned_files(tmp_path: Path, write_config: WriteConfig) -> None:
    run_toy_stages(write_config(), tmp_path / "all")
    out = tmp_path / "out"
    run_toy_stages(write_config(keep="dataset"), out)
    run_toy_stages(write_config(keep="all"), out)
    kept = {path: content for path, content in made(out).items() if not path.endswith("pruned.json")}
    assert kept == made(tmp_path / "all")


def test_kill_while_pruning_leaves_valid_records(tmp_path: Path, write_config: WriteConfig) -> None:
    """The note is there before the first file goes; what is left goes at the end of the next run."""
    run_toy_stages(write_config(), tmp_path / "all")
    config, out = write_config(keep="dataset"), tmp_path / "out"
    run_toy_stages(config, out)
    there = [path.relative_to(tmp_path / "all") for path in between(tmp_path / "all")]
    for path in there[::2]:
        (out / path).write_bytes((tmp_path / "all" / path).read_bytes())
    assert all(not result.made for result in run_toy_stages(config, out).values())
    assert not between(out)


def test_corrupted_listing_costs_time_and_nothing_else(tmp_path: Path, write_config: WriteConfig) -> None:
    config, out = write_config(keep="dataset"), tmp_path / "out"
    run_toy_stages(config, out)
    before = finished(out)
    note = out / WORK / "grain/engine/pruned.json"
    os.truncate(note, 7)
    loaded = load(config)
    assert Inventory(loaded, STAGES, DatasetPaths(out, loaded.name)).stage("grain").missing
    run_toy_stages(config, out)
    assert finished(out) == before
    assert not between(out)
