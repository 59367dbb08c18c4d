"""Set-up and the doctor, on machines where something is missing."""

from __future__ import annotations

import errno
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from pipeline import doctor, workers
from pipeline.errors import Fatal

ROOT = Path(__file__).resolve().parents[2]


def project_with_missing_library(folder: Path) -> Path:
    """A project that needs a library no machine has, and nothing else of the real one but its set-up."""
    (folder / "pipeline").mkdir(parents=True)
    shutil.copy(ROOT / "pipeline/setup.sh", folder / "pipeline")
    (folder / "pipeline/libraries.txt").write_text(
        "# library, package\nlibnowhere.so.9 libnowhere9 nobody\n", encoding="utf-8"
    )
    return folder


def set_up(project: Path, tools: Path) -> subprocess.CompletedProcess[str]:
    """Run the set-up with nothing on the PATH but `tools` and the few commands that every machine has."""
    for name in ("sh", "grep", "tr", "id", "env", "ldconfig"):
        found = shutil.which(name, path=f"{os.environ['PATH']}:/usr/sbin:/sbin")
        assert found is not None, name
        if not (tools / name).exists():
            (tools / name).symlink_to(found)
    (tools / "python3").symlink_to(sys.executable)
    return subprocess.run(
        ["sh", "pipeline/setup.sh"],
        cwd=project,
        env={"PATH": str(tools), "HOME": str(project)},
        capture_output=True,
        text=True,
        check=False,
    )


def test_set_up_names_the_packages_without_apt(tmp_path: Path) -> None:
    tools = tmp_path / "tools"
    tools.mkdir()
    done = set_up(project_with_missing_library(tmp_path / "project"), tools)
    assert done.returncode == 1
    assert "Shapemill needs what Debian calls: libnowhere9" in done.stderr
    assert not (tmp_path / "project/.venv").exists()


def test_set_up_prints_the_exact_command_where_only_root_may_install(tmp_path: Path) -> None:
    tools = tmp_path / "tools"
    tools.mkdir()
    write_programs(tools, {"apt-get": "exit 0", "id": "echo 1000"})
    done = set_up(project_with_missing_library(tmp_path / "project"), tools)
    assert done.returncode == 1
    assert "    sudo apt-get update && sudo apt-get install -y --no-install-recommends libnowhere9\n" in done.stderr
    assert not (tmp_path / "project/.venv").exists()


def write_programs(folder: Path, scripts: dict[str, str]) -> None:
    for name, script in scripts.items():
        (folder / name).write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
        (folder / name).chmod(0o755)


FAKE_PYTHON = """
case "$*" in
    *"pip install"*) echo "Collecting numpy"; echo "  Downloading numpy.whl"; sleep 6; echo "no space left"; exit 1 ;;
    "-") echo numpy ;;
esac
"""


def test_set_up_stops_with_the_exact_command_where_apt_cannot_although_pip_still_works(tmp_path: Path) -> None:
    tools = tmp_path / "tools"
    tools.mkdir()
    write_programs(tools, {"apt-get": "exit 100", "id": "echo 0"})
    project = with_fake_python(project_with_missing_library(tmp_path / "project"))
    environment = {**os.environ, "PATH": f"{tools}:{os.environ['PATH']}"}
    done = subprocess.run(
        ["sh", "pipeline/setup.sh"], cwd=project, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert "apt-get install -y --no-install-recommends libnowhere9" in done.stderr
    assert "pip failed" not in done.stderr


def with_fake_python(project: Path) -> Path:
    """Give a project an environment whose pip works for six seconds, then fails."""
    (project / "requirements.lock").write_text("--no-binary :none:\n", encoding="utf-8")
    (project / ".venv/bin").mkdir(parents=True)
    write_programs(project / ".venv/bin", {"python": FAKE_PYTHON})
    return project


def test_set_up_says_how_far_it_is_while_pip_works_and_what_pip_said_when_it_fails(tmp_path: Path) -> None:
    project = with_fake_python(project_with_missing_library(tmp_path / "project"))
    (project / "pipeline/libraries.txt").write_text("# library, package\n", encoding="utf-8")
    done = subprocess.run(["sh", "pipeline/setup.sh"], cwd=project, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "set-up: 1 packages found, 1 fetched, 0 installed, 0 kernels compiled, 5s elapsed" in done.stdout
    assert done.stderr.splitlines()[-2:] == [
        "no space left",
        "pip failed; all that it said is in .venv/install.log",
    ]


@pytest.mark.slow
def test_doctor_finds_a_library_that_does_not_load_and_names_the_package(tmp_path: Path) -> None:
    (tmp_path / "fcl.py").write_text(
        "raise ImportError('libGL.so.1: cannot open shared object file')\n", encoding="utf-8"
    )
    (tmp_path / "open3d.py").write_text("import os\nos.abort()\n", encoding="utf-8")
    (tmp_path / "torch.py").touch()
    done = subprocess.run(
        [sys.executable, "-c", "from pipeline.cli import main; main()", "doctor", "--out", str(tmp_path / "out")],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    lines = [" ".join(line.split()) for line in done.stdout.splitlines()]
    assert done.returncode == 1
    at = next(index for index, line in enumerate(lines) if line.startswith("python-fcl FAILED"))
    assert lines[at + 1] == "remedy: apt-get install libgl1"
    assert "open3d FAILED killed by signal 6" in lines
    at = next(index for index, line in enumerate(lines) if line.startswith("torch FAILED"))
    assert f"imported from {tmp_path / 'torch.py'}" in lines[at]
    assert lines[at + 1].startswith("remedy: unset PYTHONPATH")
    assert any(line.startswith("numpy ok") for line in lines)
    assert any(line.startswith("draw: raster ok") for line in lines)
    assert lines[-1] == "3 checks failed"


def test_doctor_regards_only_installed_groups(monkeypatch: pytest.MonkeyPatch) -> None:
    installed = doctor._installed
    without_models = {"torch": "", "safetensors": "", "sympy": ""}
    monkeypatch.setattr(doctor, "_installed", lambda package: without_models.get(package, installed(package)))
    groups = doctor.installed_groups()
    assert "models" not in groups
    check = doctor._locked_versions(groups)
    assert check.state == "ok", check.note
    assert "not installed: models" in check.note
    monkeypatch.setattr(doctor, "_installed", lambda package: "1.0" if package == "numpy" else installed(package))
    check = doctor._locked_versions(["models"])
    assert check.state == "FAILED"
    assert check.note.startswith("numpy is 1.0, not ")
    assert check.remedy == "pipeline/setup.sh models"


@pytest.mark.parametrize(("python", "state"), [("3.10.9", "FAILED"), ("3.11.7", "ok"), ("3.13.0", "ok")])
def test_doctor_accepts_the_versions_that_set_up_takes(
    python: str, state: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("platform.python_version", lambda: python)
    assert doctor._python().state == state
    versions = " ".join(doctor._PYTHONS)
    assert f'VERSIONS="{versions}"' in (ROOT / "pipeline/setup.sh").read_text(encoding="utf-8")


def test_run_blames_shared_memory_that_cannot_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(**_: object) -> None:
        raise OSError(errno.EROFS, "Read-only file system")

    monkeypatch.setattr(workers, "ProcessPoolExecutor", refuse)
    with pytest.raises(Fatal, match=r"/dev/shm cannot hold .*Read-only file system.*: mount a writable one"):
        workers._Worker(tmp_path / "workers.txt").submit(None)  # type: ignore[arg-type]


def test_workers_have_the_same_environment_in_every_shell(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Kernels of OpenBLAS for other processors give other last digits; a worker has the same ones everywhere."""
    products = set()
    for said in ("Haswell", "Nehalem", "Zen"):
        environment = {**os.environ, "OPENBLAS_CORETYPE": said, **workers._ENVIRONMENT}
        command = "import numpy as np; a, b = np.random.default_rng(1).random((2, 99, 99)); print((a @ b).tobytes())"
        done = subprocess.run([sys.executable, "-c", command], env=environment, capture_output=True, text=True)
        products.add(done.stdout)
    assert len(products) == 1
