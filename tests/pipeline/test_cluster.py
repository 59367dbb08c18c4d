"""A cluster of real processes makes the same bytes, whatever dies: a shard's process, a worker, the scheduler."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from pipeline.errors import ConfigError
from tests.pipeline.conftest import WriteConfig, made
from tests.pipeline.test_failures import alive, descendants, run_command, wait_until
from tests.pipeline.toy_run import run_toy_stages

pytest.importorskip("distributed")

ROOT = Path(__file__).resolve().parents[2]
WORK = Path(".work/toys")
IMPATIENT_RUN = """
import pipeline.cluster
from pipeline.cli import main
from tests.pipeline.toy_run import PACKAGE

pipeline.cluster._ANSWER_SECONDS = 1.0
main(PACKAGE)
"""
"""The toy command line, with a scheduler that has one second to answer."""


class Cluster:
    """A scheduler and its workers, as `make cluster WORKERS=2` starts them."""

    def __init__(self, workers: int = 2) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{port}"
        self.process = subprocess.Popen(
            [sys.executable, "-m", "pipeline", "cluster", "--workers", str(workers), "--port", str(port)],
            cwd=ROOT,
            stdout=subprocess.PIPE,
        )
        assert self.process.stdout is not None
        assert self.process.stdout.readline().decode().endswith(f"CLUSTER={self.address}\n")

    def pids(self, module: str) -> list[int]:
        return sorted(pid for pid in descendants(self.process.pid) if module in _command(pid))

    def end(self) -> None:
        everything = descendants(self.process.pid)
        self.process.terminate()
        assert self.process.wait(timeout=60) == 143
        wait_until(lambda: not alive(everything), seconds=20)


@pytest.fixture(scope="module")
def cluster() -> Iterator[Cluster]:
    running = Cluster()
    yield running
    running.end()


@pytest.mark.slow
def test_cluster_makes_the_same_bytes_despite_dying_workers(
    tmp_path: Path, write_config: WriteConfig, cluster: Cluster
) -> None:
    out = tmp_path / "out"
    run_toy_stages(write_config(), tmp_path / "calm", "salt", "grain", "flour")
    run_toy_stages(write_config(), out, "salt", "grain")
    trouble = {"harvest0-0": "stops once", "harvest1-0": "dies", "harvest2-1": "dies once"}
    config = write_config(flour={"trouble": trouble})
    command = [*run_command(config, out, "flour"), "--cluster", cluster.address]
    with subprocess.Popen(command, cwd=ROOT, stderr=subprocess.PIPE, text=True) as run:
        wait_until(lambda: _with_stopped(cluster.pids("dask_worker")))
        (victim,) = _with_stopped(cluster.pids("dask_worker"))
        os.kill(victim, signal.SIGKILL)
        assert run.wait(timeout=120) == 1
        assert run.stderr is not None
        assert "failed: harvest1-0; remove the cause" in run.stderr.read()
    # Each killer is one that the test knows: a worker killed while it makes the poisoned shard would count for that.
    tried = {shard: (tmp_path / "marks" / shard).read_text(encoding="utf-8") for shard in trouble}
    assert tried["harvest1-0"] == "xxxx", "three times among others, once in isolation"
    assert tried["harvest0-0"] == tried["harvest2-1"] == "xx", "a death costs a shard one more try"
    run_toy_stages(write_config(), out, "flour")
    assert made(out) == made(tmp_path / "calm"), "a run that moves from a cluster to this machine"


@pytest.mark.slow
def test_shard_ends_with_its_run_and_the_cluster_survives(
    tmp_path: Path, write_config: WriteConfig, cluster: Cluster
) -> None:
    out, small = tmp_path / "out", {"fields": 1, "wanted": 1}
    config = write_config(grain=small, flour={"trouble": {"harvest0-0": "sleeps"}})
    run_toy_stages(config, out, "salt", "grain", cluster=cluster.address)
    with subprocess.Popen([*run_command(config, out, "flour"), "--cluster", cluster.address], cwd=ROOT) as run:
        wait_until(lambda: (tmp_path / "marks/harvest0-0").exists())
        makers = cluster.pids("LokyProcess")
        run.kill()
    assert makers
    wait_until(lambda: not set(makers) <= set(cluster.pids("LokyProcess")), seconds=30)
    result = run_toy_stages(config, out, "flour", cluster=cluster.address, stall_minutes=2 / 60, retries=0)["flour"]
    assert result.failed == {"harvest0-0": "it made no progress for 2s, and its worker was killed"}
    assert not run_toy_stages(write_config(grain=small), out, "flour", cluster=cluster.address)["flour"].failed


@pytest.mark.slow
def test_lost_scheduler_is_reported_and_the_run_continues_here(
    tmp_path: Path, write_config: WriteConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pipeline.cluster._ANSWER_SECONDS", 1.0)
    out, mine = tmp_path / "out", Cluster(workers=1)
    # The last shard waits for ever in the first run, and is made by the next.
    config = write_config(grain={"wanted": 9}, flour={"trouble": {"harvest1-1": "stops once"}})
    run_toy_stages(config, out, "salt", "grain")
    _, _, _, *arguments = run_command(config, out, "flour")
    command = [sys.executable, "-c", IMPATIENT_RUN, *arguments, "--cluster", mine.address]
    with subprocess.Popen(command, cwd=ROOT, stderr=subprocess.PIPE, text=True) as run:
        wait_until(lambda: (tmp_path / "marks/harvest1-1").exists())
        assert list((out / WORK / "flour").glob("records/*.json"))
        os.kill(mine.pids("dask_scheduler")[0], signal.SIGKILL)
        assert run.wait(timeout=120) == 3
        assert run.stderr is not None
        said = run.stderr.read()
        assert f"stopped: the scheduler at {mine.address} no longer answers" in said
        assert "run again to go on" in said
        assert "Traceback" not in said
    assert mine.process.wait(timeout=60) == 1
    with pytest.raises(ConfigError, match=f"no scheduler answers at {mine.address}"):
        run_toy_stages(config, out, "flour", cluster=mine.address)
    run_toy_stages(config, out, "flour")
    run_toy_stages(config, tmp_path / "calm", "salt", "grain", "flour")
    assert made(out) == made(tmp_path / "calm")


def _with_stopped(pids: list[int]) -> list[int]:
    """Those of the processes that have started one which is stopped now."""
    return [pid for pid in pids if any("\nState:\tT" in _read(descendant, "status") for descendant in descendants(pid))]


def _command(pid: int) -> str:
    return _read(pid, "cmdline")


def _read(pid: int, file: str) -> str:
    try:
        return Path(f"/proc/{pid}/{file}").read_text(encoding="utf-8")
    except (FileNotFoundError, ProcessLookupError):
        return ""
