"""What goes wrong, and what each failure costs: one item, one shard, or everything."""

from __future__ import annotations

import contextlib
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from pipeline.errors import ConfigError, Fatal
from tests.pipeline.conftest import WriteConfig, made
from tests.pipeline.toy_run import run_toy_stages

ROOT = Path(__file__).resolve().parents[2]
WORK = Path(".work/toys")


def run_command(config: Path, out: Path, stage: str, workers: int = 1) -> list[str]:
    command = [sys.executable, "-m", "tests.pipeline.toy_run", "run", stage]
    return [*command, "--config", str(config), "--out", str(out), "--workers", str(workers)]


def wait_until(true: Callable[[], object], seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.05)


def descendants(pid: int) -> set[int]:
    """All processes that `pid` has started, whichever of its threads did, and theirs."""
    children: set[int] = set()
    for path in Path(f"/proc/{pid}/task").glob("*/children"):
        with contextlib.suppress(OSError):
            children |= {int(child) for child in path.read_text(encoding="utf-8").split()}
    return children.union(*map(descendants, children))


def alive(pids: set[int]) -> bool:
    return any(Path(f"/proc/{pid}/cmdline").exists() and Path(f"/proc/{pid}/cmdline").read_bytes() for pid in pids)


def test_killed_run_goes_on_to_the_same_bytes_and_leaves_no_worker(tmp_path: Path, write_config: WriteConfig) -> None:
    # One shard stays half written in the first run, and is made by the next.
    config, out = write_config(flour={"trouble": {"harvest1-1": "stops once"}}), tmp_path / "killed"
    run_toy_stages(config, out, "salt", "grain")
    with subprocess.Popen(run_command(config, out, "flour", workers=2), cwd=ROOT, stderr=subprocess.DEVNULL) as run:
        flour = out / WORK / "flour"
        wait_until(lambda: list(flour.glob("records/*.json")) and (tmp_path / "marks/harvest1-1").exists())
        assert list(flour.glob(".*.tmp"))
        workers = descendants(run.pid)
        os.kill(max(workers), signal.SIGSTOP)
        run.send_signal(signal.SIGKILL)
    assert len(workers) >= 2
    wait_until(lambda: not alive(workers), seconds=10)
    assert 0 < len(list(flour.glob("records/*.json"))) < 6
    result = run_toy_stages(config, out)["flour"]
    assert 0 < result.made < 6
    run_toy_stages(config, tmp_path / "whole", workers=2)
    assert made(out) == made(tmp_path / "whole")


def test_shard_whose_worker_dies_once_is_made_by_another(tmp_path: Path, write_config: WriteConfig) -> None:
    run_toy_stages(write_config(), tmp_path / "calm", "salt", "grain", "flour")
    config = write_config(flour={"trouble": {"harvest1-0": "dies once"}})
    results = run_toy_stages(config, tmp_path / "troubled", "salt", "grain", "flour", workers=2)
    assert not results["flour"].failed
    shards = [made(tmp_path / out)[str(WORK / "flour/harvest1-0.tar")] for out in ("calm", "troubled")]
    assert shards[0] == shards[1]
    assert (tmp_path / "marks/harvest1-0").read_text(encoding="utf-8") == "xx"


def test_shard_that_keeps_killing_its_worker_is_quarantined_and_the_rest_is_made(
    tmp_path: Path, write_config: WriteConfig
) -> None:
    config = write_config(flour={"trouble": {"harvest0-1": "dies"}})
    run_toy_stages(config, tmp_path / "out", "salt", "grain")
    run = subprocess.run(
        run_command(config, tmp_path / "out", "flour", workers=2), cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert run.returncode == 1
    assert "flour: failed: harvest0-1" in run.stderr
    assert (tmp_path / "marks/harvest0-1").read_text(encoding="utf-8") == "xxxx", (
        "three times among others, once in isolation"
    )
    flour = tmp_path / "out" / WORK / "flour"
    assert len(list(flour.glob("*.tar"))) == 5
    assert not list(flour.glob(".*.tmp"))
    assert "worker process died" in json.loads((flour / "failed/harvest0-1.json").read_bytes())["message"]
    with pytest.raises(ConfigError, match="bread reads flour, and 1 of its 6 shards"):
        run_toy_stages(config, tmp_path / "out", "bread")


def test_shard_that_fails_once_is_made_at_the_second_try(tmp_path: Path, write_config: WriteConfig) -> None:
    config = write_config(flour={"trouble": {"harvest0-1": "fails once"}})
    assert not run_toy_stages(config, tmp_path / "out", "salt", "grain", "flour")["flour"].failed
    assert (tmp_path / "marks/harvest0-1").read_text(encoding="utf-8") == "xx"


def test_failing_shard_is_tried_three_times_then_quarantined_until_the_next_run(
    tmp_path: Path, write_config: WriteConfig
) -> None:
    config = write_config(flour={"trouble": {"harvest2-0": "fails"}})
    result = run_toy_stages(config, tmp_path / "out", "salt", "grain", "flour")["flour"]
    assert result.failed == {"harvest2-0": "the stones are blunt"}
    assert result.made == 5
    assert (tmp_path / "marks/harvest2-0").read_text(encoding="utf-8") == "xxx"
    failed = tmp_path / "out" / WORK / "flour/failed/harvest2-0.json"
    assert "ShardFailed: the stones are blunt" in json.loads(failed.read_bytes())["trace"]
    assert run_toy_stages(config, tmp_path / "out", "flour")["flour"].failed == result.failed
    assert (tmp_path / "marks/harvest2-0").read_text(encoding="utf-8") == "xxxxxx"
    assert not run_toy_stages(write_config(), tmp_path / "out", "flour")["flour"].failed
    assert not failed.exists()


def test_shard_refused_as_a_whole_is_not_tried_again(tmp_path: Path, write_config: WriteConfig) -> None:
    config = write_config(flour={"trouble": {"harvest2-0": "refuses"}})
    result = run_toy_stages(config, tmp_path / "out", "salt", "grain", "flour")["flour"]
    assert result.failed == {"harvest2-0": "stones in the grain"}
    assert (tmp_path / "marks/harvest2-0").read_text(encoding="utf-8") == "x"


def test_no_space_stops_everything_and_leaves_whole_files(tmp_path: Path, write_config: WriteConfig) -> None:
    config = write_config(flour={"trouble": {"harvest0-1": "no space"}})
    with pytest.raises(Fatal, match=r"shard harvest0-1 of flour: .*No space left on device"):
        run_toy_stages(config, tmp_path / "out", "salt", "grain", "flour")
    flour = tmp_path / "out" / WORK / "flour"
    assert [path.name for path in flour.glob("*.tar")] == ["harvest0-0.tar"]
    assert not [path for path in flour.rglob("*") if path.suffix == ".tmp"]
    assert not list((flour / "progress").iterdir())


def test_file_over_the_limit_of_the_machine_stops_everything(tmp_path: Path, write_config: WriteConfig) -> None:
    config = write_config(flour={"trouble": {"harvest0-1": "big"}})
    run_toy_stages(config, tmp_path / "out", "salt", "grain")
    run = subprocess.run(
        run_command(config, tmp_path / "out", "flour"),
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (8_000_000, 8_000_000)),
    )
    assert run.returncode == 3, run.stderr
    assert "File too large" in run.stderr
    flour = tmp_path / "out" / WORK / "flour"
    assert sorted(path.name for path in flour.glob("*.*")) == ["harvest0-0.tar"]
    assert not list(flour.glob(".*.tmp"))


@pytest.mark.skipif(shutil.which("unshare") is None, reason="needs unshare to mount a small disk")
def test_full_disk_stops_everything_and_the_next_run_goes_on(tmp_path: Path, write_config: WriteConfig) -> None:
    disk, config = tmp_path / "disk", write_config(flour={"trouble": {"harvest0-1": "big"}})
    disk.mkdir()
    run_toy_stages(config, tmp_path / "out", "salt", "grain")
    flour = " ".join(run_command(config, disk / "out", "flour"))
    script = f"mount -t tmpfs -o size=8m none {disk} || exit 77; cp -a {tmp_path}/out {disk}/out; {flour}; code=$?; "
    script += f"find {disk}/out -name '*.tmp'; ls {disk}/out/.work/toys/flour; exit $code"
    run = subprocess.run(
        ["unshare", "--map-root-user", "--mount", "sh", "-c", script],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    if run.returncode == 77 or "unshare:" in run.stderr:
        pytest.skip("this machine lets nobody mount a small disk")
    assert run.returncode == 3, run.stderr
    assert "No space left on device" in run.stderr
    assert run.stdout.split() == ["engine", "failed", "harvest0-0.tar", "progress", "records", "rejects"]


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_folder_that_cannot_be_written_stops_everything(tmp_path: Path, write_config: WriteConfig) -> None:
    tmp_path.joinpath("out").mkdir(mode=0o500)
    with pytest.raises(Fatal, match="cannot make folders"):
        run_toy_stages(write_config(), tmp_path / "out", "salt")


def test_out_that_is_a_file_is_reported(tmp_path: Path, write_config: WriteConfig) -> None:
    (tmp_path / "out").write_text("not a folder", encoding="utf-8")
    with pytest.raises(Fatal, match=r"cannot make folders under .*out"):
        run_toy_stages(write_config(), tmp_path / "out", "salt")


def test_second_run_in_the_same_place_is_refused(tmp_path: Path, write_config: WriteConfig) -> None:
    config = write_config(flour={"seconds": 0.5})
    out = tmp_path / "out"
    run_toy_stages(config, out, "salt", "grain")
    with subprocess.Popen(run_command(config, out, "flour"), cwd=ROOT, stderr=subprocess.DEVNULL) as run:
        wait_until(lambda: list((out / WORK / "flour").glob(".*.tmp")))
        with pytest.raises(ConfigError, match="another run works"):
            run_toy_stages(config, out, "flour")
        run.kill()


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_signal_ends_the_run_and_all_workers_and_leaves_complete_files(
    tmp_path: Path, write_config: WriteConfig, number: int, code: int
) -> None:
    config = write_config(flour={"seconds": 0.5})
    out = tmp_path / "out"
    run_toy_stages(config, out, "salt", "grain")
    with subprocess.Popen(
        run_command(config, out, "flour"),
        cwd=ROOT,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
        # whoever runs the tests in the background has them ignore Ctrl-C, and a child inherits that
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    ) as run:
        wait_until(lambda: list((out / WORK / "flour").glob(".*.tmp")))
        workers = descendants(run.pid)
        os.kill(max(workers), signal.SIGSTOP)
        os.killpg(run.pid, number)
        assert run.wait(timeout=30) == code
    wait_until(lambda: not alive(workers), seconds=10)
    assert not list((out / WORK / "flour").rglob("*.tmp"))
