"""A stalled shard is detected, killed, retried and quarantined."""

from __future__ import annotations

import json
import os
import signal
import time
from pathlib import Path

import pytest

from pipeline import workers
from pipeline.inventory import Inventory
from pipeline.paths import DatasetPaths, StagePaths
from pipeline.stage import Shard
from pipeline.stall_timeout import StallWatch
from pipeline.task import Job
from pipeline.workers import Workers
from tests.pipeline.conftest import WriteConfig
from tests.pipeline.test_failures import alive, descendants, wait_until
from tests.pipeline.toy_run import STAGES, load, run_toy_stages

WORK = Path(".work/toys")


@pytest.fixture
def bag(tmp_path: Path, write_config: WriteConfig) -> Job:
    places = DatasetPaths(tmp_path / "out", "toys")
    places.stage("salt").make()
    inventory = Inventory(load(write_config()), STAGES, places)
    inventory.stage("salt")
    return inventory.job("salt", Shard("bag-0", {"samples": 1}))


def test_stalled_shard_is_killed_retried_and_quarantined_and_the_rest_is_made(
    tmp_path: Path, write_config: WriteConfig, capfd: pytest.CaptureFixture[str]
) -> None:
    config = write_config(
        grain={"fields": 2, "wanted": 1}, flour={"trouble": {"harvest0-0": "stops once", "harvest0-1": "sleeps"}}
    )
    before = descendants(os.getpid())
    results = run_toy_stages(
        config, tmp_path / "out", "salt", "grain", "flour", workers=2, stall_minutes=4 / 60, retries=1
    )
    message = "it made no progress for 4s, and its worker was killed"
    assert results["flour"].failed == {"harvest0-1": message}
    assert results["flour"].made == 1
    assert [(tmp_path / "marks" / name).read_text(encoding="utf-8") for name in ("harvest0-0", "harvest0-1")] == [
        "xx",
        "xx",
    ]
    flour = tmp_path / "out" / WORK / "flour"
    assert json.loads((flour / "failed/harvest0-1.json").read_bytes())["message"] == message
    assert sorted(path.name for path in flour.glob("*.*")) == ["harvest0-0.tar"]
    assert not list(flour.glob(".*.tmp"))
    assert f"flour: shard harvest0-0: {message}" in capfd.readouterr().err
    assert not [pid for pid in descendants(os.getpid()) - before if "LokyProcess" in _command(pid)]


def test_any_change_counts_as_progress(bag: Job, monkeypatch: pytest.MonkeyPatch) -> None:
    places = bag.paths.stage("salt")
    watch, start, growing = quick_watch(0.4, places, monkeypatch), time.monotonic(), places.root / ".bag-0.txt.tmp"
    (places.progress / "bag-0").write_text("1 4", encoding="utf-8")
    while time.monotonic() - start < 1.2:
        growing.write_bytes(b"a" * int(100 * (time.monotonic() - start)))
        assert not watch.stalled([bag])
        time.sleep(0.02)
    while not watch.stalled([bag]):
        (places.progress / "bag-0").write_text("1 4", encoding="utf-8")
        assert time.monotonic() - start < 20, "the same words again are no progress"
        time.sleep(0.02)
    watch.restart("bag-0")
    start = time.monotonic()
    while not watch.stalled([bag]):
        time.sleep(0.02)
    assert time.monotonic() - start >= 0.35, "a retried shard has its full time"


def test_timeout_of_0_never_ends_a_shard(bag: Job, monkeypatch: pytest.MonkeyPatch) -> None:
    watch = quick_watch(0, bag.paths.stage("salt"), monkeypatch)
    time.sleep(0.1)
    assert not watch.stalled([bag])


def test_time_in_which_the_engine_was_stopped_does_not_count(bag: Job, monkeypatch: pytest.MonkeyPatch) -> None:
    watch = quick_watch(0.4, bag.paths.stage("salt"), monkeypatch)
    time.sleep(0.1)
    watch.stalled([bag])
    time.sleep(0.6)
    assert not watch.stalled([bag])


def test_stopped_idle_worker_does_not_delay_the_end(bag: Job, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers, "_EXIT_SECONDS", 0.5)
    crew, before = Workers(1, bag.paths.worker_output), descendants(os.getpid())
    crew.submit(bag)
    assert [report and report.status for _, report in crew.finished(None)] == ["done"]
    worker = {pid for pid in descendants(os.getpid()) - before if "LokyProcess" in _command(pid)}
    assert len(worker) == 1
    os.kill(max(worker), signal.SIGSTOP)
    crew.stop(kill=False)
    wait_until(lambda: not alive(worker), seconds=10)


def quick_watch(seconds: float, places: StagePaths, monkeypatch: pytest.MonkeyPatch) -> StallWatch:
    """A watch that looks every twentieth of a second, where others look twice a second at most."""
    watch = StallWatch(seconds / 60, places)
    monkeypatch.setattr(watch, "_interval", 0.05)
    return watch


def _command(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/cmdline").read_text(encoding="utf-8")
    except FileNotFoundError:
        return ""
