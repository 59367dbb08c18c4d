"""What people see of a run: no bar that stays, nothing of stages without work, and no guess at the time left."""

from __future__ import annotations

import itertools
import os
import pty
import subprocess
import sys
import termios
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.config import Config, StrictModel
from pipeline.display import ticking, watching
from pipeline.event_log import EventLog, Progress, progress_text
from pipeline.paths import DatasetPaths
from pipeline.run import run_stage
from pipeline.stage import Outcome, Stage
from pipeline.time_left import TimeLeft
from tests.pipeline.conftest import WriteConfig
from tests.pipeline.toy_run import run_toy_stages

ROOT = Path(__file__).resolve().parents[2]


def reported(worked: Callable[[float], float], work: float, seconds: int) -> Iterator[tuple[float, float | None]]:
    """What is said of the time left, twice a second, of work that goes on like `worked`."""
    watch = TimeLeft()
    for now in np.arange(0.0, seconds, 0.5):
        yield float(now), watch.after(worked(float(now)), work, float(now))


def test_time_left_is_unknown_while_workers_start_and_then_right() -> None:
    # Thirty seconds of imports, then ten samples a second: 1,000 samples are there after 130 seconds.
    for now, left in reported(lambda now: max(now - 30, 0) * 10, 1000, 130):
        if now < 35:
            assert left is None
        elif now > 40:
            assert left == pytest.approx(130 - now, abs=1.0)


def test_time_left_does_not_jump_when_shards_end_together() -> None:
    # Fifty samples at a time, one time in three at half the pace, as shards of few and of many parts are.
    def worked(now: float) -> float:
        return 50.0 * int(now / 15 if int(now / 45) % 2 else now / 7.5)

    answers = [left for _, left in reported(worked, 2000, 240) if left is not None]
    assert len(answers) > 300
    steps = [after - before for before, after in itertools.pairwise(answers)]
    assert max(map(abs, steps)) < 0.1 * max(answers)


def test_work_before_the_start_does_not_change_the_pace() -> None:
    answers = dict(reported(lambda now: 900 + now, 1000, 60))
    assert answers[50.0] == pytest.approx(50, abs=1)


def test_time_left_is_unknown_without_a_count_and_at_the_end() -> None:
    assert all(left is None for _, left in reported(lambda _: 0.0, 0.0, 100))
    assert TimeLeft().after(5.0, 5.0, 10.0) is None


def test_progress_counts_samples_where_the_plan_has_their_number() -> None:
    known = Progress(planned=24, done=12, failed=1, work=1200, worked=512.6, samples=500, rejects=7)
    assert progress_text(known, 41.0, 58.2) == (
        "512 of 1,200 samples, 12 of 24 shards, 7 rejects, 1 quarantined, 41s elapsed, about 58s left"
    )
    grows = Progress(planned=8, done=6.4, failed=0, work=0, worked=0.0, samples=0, rejects=0)
    assert progress_text(grows, 41.0, None) == "6.4 of 8 shards, 41s elapsed"
    named = replace(grows, running=("castle", "temple", "tower"))
    assert progress_text(named, 41.0, None) == "6.4 of 8 shards (castle, temple, …), 41s elapsed"


def test_progress_says_that_kernels_are_compiled(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    idle = Progress(planned=4, done=0, failed=0, work=0, worked=0.0, samples=0, rejects=0)
    waiting, compiling = replace(idle, kernels=0), replace(idle, kernels=112)
    assert progress_text(waiting, 9.0, None) == "0.0 of 4 shards, compiling kernels, once on this machine, 9s elapsed"
    assert "once on this machine (112 done), 9s" in progress_text(compiling, 9.0, None)


def test_lines_are_at_most_five_seconds_apart_in_the_first_minute_and_twenty_later(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    now = 0.0
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("pipeline.display.time.monotonic", lambda: now)
        log = EventLog("exemplars", tmp_path / "log")
        while now < 200.0:
            log.show(Progress(planned=4, done=0, failed=0, work=0, worked=0.0, samples=0, rejects=0))
            now += 0.5
    lines = capsys.readouterr().err.splitlines()
    assert [line.split(", ")[-1] for line in lines[:3]] == ["5s elapsed", "10s elapsed", "15s elapsed"]
    assert [line.split(", ")[-1] for line in lines[11:14]] == ["1m00s elapsed", "1m20s elapsed", "1m40s elapsed"]
    assert lines[0] == "exemplars: 0.0 of 4 shards, 5s elapsed"
    logged = (tmp_path / "log").read_text(encoding="utf-8").splitlines()
    assert [line.partition(" ")[2] for line in logged] == lines


def test_command_that_says_nothing_shows_the_time_that_passes(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pipeline.display._REFRESH_SECONDS", 0.01)
    monkeypatch.setattr("pipeline.display.FIRST_LINE_SECONDS", 0.05)
    with ticking("inspect", "looking for contacts"):
        time.sleep(0.3)
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) >= 2
    assert set(lines) == {"inspect: looking for contacts, 0s elapsed"}


def test_count_is_asked_for_again_and_again(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pipeline.display._REFRESH_SECONDS", 0.01)
    monkeypatch.setattr("pipeline.display.FIRST_LINE_SECONDS", 0.0)
    asked: list[int] = []

    def done() -> int:
        asked.append(100 * len(asked))
        return asked[-1]

    with watching("verify", 1200, "samples", done):
        while len(asked) < 4:
            time.sleep(0.01)
    lines = capsys.readouterr().err.splitlines()
    assert [line.split(", ")[0] for line in lines[:3]] == [
        f"verify: {count} of 1,200 samples" for count in (0, 100, 200)
    ]


def seen_on_a_terminal(*arguments: object) -> str:
    """Return all that a run of the toy stages writes to a terminal."""
    ours, theirs = pty.openpty()
    termios.tcsetwinsize(theirs, (40, 120))
    command = [sys.executable, "-m", "tests.pipeline.toy_run", *(str(argument) for argument in arguments)]
    running = subprocess.Popen(command, cwd=ROOT, stdout=theirs, stderr=theirs)
    os.close(theirs)
    written = bytearray()
    while True:
        try:
            written += os.read(ours, 4096)
        except OSError:  # how a terminal says that nobody has it open any more
            break
    assert running.wait() == 0
    os.close(ours)
    return written.decode()


def test_a_terminal_shows_a_bar_with_samples_while_it_works_and_none_afterwards(
    tmp_path: Path, write_config: WriteConfig
) -> None:
    config = write_config(flour={"seconds": 0.3})
    run_toy_stages(config, tmp_path / "out", "grain")
    shown = seen_on_a_terminal("run", "flour", "--config", config, "--out", tmp_path / "out", "--workers", 2)
    assert "of 24 samples" in shown
    assert "% |" in shown
    left = [line.rpartition("\r")[2] for line in shown.replace("\r\n", "\n").split("\n")]
    assert left[0] == "flour: 6 shards to make, about 100.0 kB of disk (4.2 kB per sample)"
    assert left[1].startswith("flour: 6 of 6 shards, 24 samples, 61.4 kB, 6 shards made now")
    assert left[2:] == [""]


def test_stage_without_a_plan_prints_nothing(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    idle = Stage("idle", __name__, StrictModel, (), lambda _: [], lambda _: Outcome(0), lambda _: 0)
    config = Config("toys", "1.0.0", 0, {"idle": StrictModel()}, tmp_path / "toys.yaml")
    assert run_stage("idle", {"idle": idle}, config, DatasetPaths(tmp_path, "toys"), workers=1).left == 0
    assert capfd.readouterr() == ("", "")
