"""Set-up, the Makefile and the doctor, on machines where something is missing."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def project_with_missing_library(folder: Path) -> Path:
    """A project that needs a library no machine has, and nothing else of the real one but its set-up."""
    (folder / "pipeline").mkdir(parents=True)
    shutil.copy(ROOT / "pipeline/setup.sh", folder / "pipeline")
    (folder / "pipeline/libraries.txt").write_text("# library, package\nlibnowhere.so.9 libnowhere9 nobody\n")
    return folder


def set_up(project: Path, tools: Path) -> subprocess.CompletedProcess[str]:
    """Run the set-up with nothing on the PATH but `tools` and the few commands that every machine has."""
    for name in ("sh", "grep", "tr", "id", "env", "ldconfig"):
        found = shutil.which(name, path=f"{os.environ['PATH']}:/usr/sbin:/sbin")
        assert found is not None, name
        (tools / name).symlink_to(found)
    (tools / "python3.11").symlink_to(sys.executable)
    return subprocess.run(
        ["sh", "pipeline/setup.sh"],
        cwd=project,
        env={"PATH": str(tools), "HOME": str(project)},
        capture_output=True,
        text=True,
        check=False,
    )


def test_set_up_names_the_packages_where_there_is_no_apt(tmp_path: Path) -> None:
    tools = tmp_path / "tools"
    tools.mkdir()
    done = set_up(project_with_missing_library(tmp_path / "project"), tools)
    assert done.returncode == 1
    assert "Shapemill needs what Debian 12 calls: libnowhere9" in done.stderr
    assert not (tmp_path / "project/.venv").exists()


def test_set_up_prints_the_exact_command_where_apt_may_not_or_cannot(tmp_path: Path) -> None:
    tools = tmp_path / "tools"
    tools.mkdir()
    (tools / "apt-get").write_text("#!/bin/sh\nexit 100\n")
    (tools / "apt-get").chmod(0o755)
    done = set_up(project_with_missing_library(tmp_path / "project"), tools)
    assert done.returncode == 1
    assert "apt-get install -y --no-install-recommends libnowhere9" in done.stderr
    assert not (tmp_path / "project/.venv").exists()


def make(*arguments: str) -> str:
    # The stamp is given, so that nothing is set up by asking what would be done.
    command = ["make", "--no-print-directory", "READY=Makefile", *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout


def test_make_dataset_runs_each_stage_once_after_what_it_reads() -> None:
    lines = make("-n", "dataset", "CONFIG=c.yaml", "OUT=/data", "WORKERS=3", "SEED=7").splitlines()
    assert [line.split(" run ")[1].split()[0] for line in lines] == [
        "exemplars", "variations", "programs", "shapeassembly", "validity", "strings", "points", "sketches", "package",
    ]  # fmt: skip
    assert all(line.endswith("--config c.yaml --out /data --seed 7 --workers 3") for line in lines)


def test_make_help_lists_every_target_and_the_live_variables() -> None:
    text = make("help", "OUT=/data", "WORKERS=3")
    rows = {line.split()[0]: line.split() for line in text.splitlines() if line.startswith("  ")}
    phony = [line for line in (ROOT / "Makefile").read_text().splitlines() if line.startswith(".PHONY:")]
    assert {target for line in phony for target in line.split()[1:]} <= set(rows)
    assert (rows["OUT"][1], rows["WORKERS"][1]) == ("/data", "3")


def test_make_inspect_without_a_model_says_what_is_missing() -> None:
    command = ["make", "READY=Makefile", "inspect"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "make inspect needs MESH=my.glb or PROGRAM=chair" in done.stderr


@pytest.mark.slow
def test_doctor_finds_a_library_that_does_not_load_and_names_the_package(tmp_path: Path) -> None:
    (tmp_path / "fcl.py").write_text("raise ImportError('libGL.so.1: cannot open shared object file')\n")
    (tmp_path / "igraph.py").write_text("import os\nos.abort()\n")
    done = subprocess.run(
        [sys.executable, "-m", "pipeline", "doctor", "--out", str(tmp_path / "out")],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    lines = [" ".join(line.split()) for line in done.stdout.splitlines()]
    assert done.returncode == 1
    at = next(index for index, line in enumerate(lines) if line.startswith("python-fcl FAILED"))
    assert lines[at + 1] == "mend: apt-get install libgl1"
    assert "igraph FAILED killed by signal 6" in lines
    assert any(line.startswith("numpy ok") for line in lines)
    assert any(line.startswith("draw: raycast ok") for line in lines)
    assert lines[-1] == "2 of these must be mended"
