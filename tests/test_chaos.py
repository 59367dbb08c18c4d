"""The short form of `make chaos`: a round over two real stages, and what a round must not let pass."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.chaos.sandbox import Sandbox
from tests.chaos.tally import Tally

ROOT = Path(__file__).resolve().parents[1]


@pytest.mark.slow
def test_a_round_of_chaos_keeps_every_guarantee() -> None:
    faults = ["end the driver", "corrupt a finished shard"]
    command = [
        sys.executable,
        "-m",
        "tests.chaos",
        "--sandbox",
        "texts",
        "--rounds",
        "1",
        "--seed",
        "4",
        "--only",
        *faults,
    ]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("then with 0 and the same bytes") == 1, done.stdout


def test_half_written_files_under_a_final_name_are_found(tmp_path: Path) -> None:
    sandbox = Sandbox(tmp_path, "toy", [("toy", "first")], {"toy": {}})
    (sandbox.work / "toy/first/records").mkdir(parents=True)
    for name in ("a.tar", "b.tar", "c.tar"):
        (sandbox.work / "toy/first" / name).write_bytes(b"whole")
    sandbox.expected = sandbox.digests()
    (sandbox.work / "toy/first/a.tar").write_bytes(b"who")
    (sandbox.work / "toy/first/b.tar").unlink()
    (sandbox.work / "toy/first/.b.tar.tmp").write_bytes(b"wh")
    (sandbox.work / "toy/first/records/a.json").write_bytes(b"{")
    (sandbox.work / "toy/log.txt").write_text("a log", encoding="utf-8")
    first = ".work/toy/first"
    assert sorted(sandbox.half_written(set())) == [f"{first}/a.tar", f"{first}/records/a.json"]
    assert sandbox.half_written({f"{first}/a.tar"}) == [f"{first}/records/a.json"]


def test_the_table_counts_rounds_by_fault_sandbox_and_result() -> None:
    tally = Tally()
    tally.add("kill", "kits", "injected", 0)
    tally.add("kill", "vases", "late", 0)
    tally.add("fill", "vases", "injected", 3)
    tally.add("fill", "vases", "wrong", None)
    rows = [line.split() for line in tally.lines()]
    assert rows[0] == ["fault", "kits", "vases", "rounds", "injected", "missed", "late", "wrong", "codes"]
    assert rows[1] == ["fill", "0/0", "1/2", "2", "1", "0", "0", "1", "3:", "1,", "?:", "1"]
    assert rows[2] == ["kill", "1/1", "0/1", "2", "1", "0", "1", "0", "0:", "2"]
    assert rows[3][:8] == ["all", "1/1", "1/3", "4", "2", "0", "1", "1"]
