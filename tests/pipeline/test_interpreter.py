"""The command line in other locales, and with a PYTHONPATH or PYTHONSAFEPATH that would harm it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from pipeline.interpreter import hidden_packages

ROOT = Path(__file__).resolve().parents[2]
LOCALES = [
    {"LC_ALL": "C"},
    {"LC_ALL": "POSIX", "PYTHONUTF8": "0"},
    {"LC_ALL": "POSIX", "PYTHONUTF8": "0", "PYTHONIOENCODING": "iso-8859-1"},
]


def shapemill(*arguments: str, **variables: str) -> subprocess.CompletedProcess[bytes]:
    given = {name: value for name, value in os.environ.items() if not name.startswith(("LC_", "LANG", "PYTHON"))}
    command = [sys.executable, "-m", "pipeline", *arguments]
    return subprocess.run(command, cwd=ROOT, env={**given, **variables}, capture_output=True, check=False)


@pytest.mark.slow
@pytest.mark.parametrize("variables", LOCALES, ids=["C", "POSIX", "latin-1"])
def test_help_plan_and_run_work_in_every_locale(tmp_path: Path, variables: dict[str, str]) -> None:
    config = tmp_path / "stühle.yaml"
    texts = tmp_path / "stühle"
    texts.mkdir()
    shutil.copy(ROOT / "datasets/exemplars/programs/stool-tripod.txt", texts / "höcker.txt")
    credit = {"author": "Käthe → 椅子", "license": "MIT"}
    programs = [{"name": "stool", "path": str(texts), "credit": credit}]
    sections = {
        "name": "stools",
        "title": "Stühle → 椅子",
        "license": "MIT",
        "shapeassembly": {"programs": programs, "splits": {"val": 0.0, "test": 0.0, "shards": 1}},
        "points": {"uniform": 64, "farthest": 16, "pool": 1000},
        "sketches": {"renderer": "raster", "size": 64},
        "package": {"previewed": 1},
    }
    config.write_text(yaml.safe_dump(sections, allow_unicode=True), encoding="utf-8")
    options = ["--config", str(config), "--out", str(tmp_path / "größe")]
    for arguments in (["--help"], ["plan", *options], ["run", "shapeassembly", "--workers", "1", *options]):
        done = shapemill(*arguments, **variables)
        assert done.returncode == 0, done.stderr.decode()
        assert b"Traceback" not in done.stderr
    assert list((tmp_path / "größe").rglob("stools-train-*.tar"))


def test_error_shows_characters_that_the_locale_lacks(tmp_path: Path) -> None:
    config = tmp_path / "broken.yaml"
    config.write_text("name: heaps\nstühle→: 1\n", encoding="utf-8")
    for variables in LOCALES:
        done = shapemill("plan", "--config", str(config), **variables)
        assert done.returncode == 2
        assert b"Traceback" not in done.stderr
        assert b"hle" in done.stderr


def foreign_numpy(folder: Path) -> Path:
    """Write a numpy that cannot be imported, as another project's PYTHONPATH may hold."""
    (folder / "numpy").mkdir(parents=True)
    (folder / "numpy" / "__init__.py").write_text("raise ImportError('the numpy of another project')", encoding="utf-8")
    return folder


def test_packages_of_the_environment_are_used_before_those_of_the_pythonpath(tmp_path: Path) -> None:
    folder = foreign_numpy(tmp_path / "other")
    run = ("programs", "make", "chair", "base", "--out", str(tmp_path / "out"))
    done = shapemill(*run, PYTHONPATH=str(folder), PYTHONSAFEPATH="")
    assert done.returncode == 0, done.stderr.decode()
    assert f"PYTHONPATH holds {folder / 'numpy'}" in done.stderr.decode()


def test_other_folders_of_the_pythonpath_hide_nothing(tmp_path: Path) -> None:
    packages = tmp_path / "packages"
    for package in ("numpy", "yaml"):
        (packages / package).mkdir(parents=True)
        (packages / package / "__init__.py").touch()
    foreign = foreign_numpy(tmp_path / "other")
    extension = tmp_path / "extension"
    (extension / "stages" / "numpy").mkdir(parents=True)
    assert hidden_packages(packages, "") == []
    assert hidden_packages(packages, f"{extension}::{tmp_path / 'missing'}") == []
    assert hidden_packages(packages, f"{extension}:{foreign}") == [str(foreign / "numpy")]
    assert hidden_packages(packages, f"{packages}:{foreign}") == []


def test_makefile_runs_from_the_checkout_with_a_safe_path() -> None:
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert "\nunexport PYTHONSAFEPATH\n" in text


@pytest.mark.parametrize(
    ("arguments", "group"), [(["train"], "models"), (["recover", "scan.xyz"], "models"), (["cluster"], "cluster")]
)
def test_commands_name_the_group_that_is_not_installed(arguments: list[str], group: str) -> None:
    hidden = "for name in ('torch', 'safetensors', 'dask', 'distributed'): sys.modules[name] = None"
    code = f"import sys\n{hidden}\nfrom pipeline.cli import main\nmain()"
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments], cwd=ROOT, capture_output=True, encoding="utf-8", check=False
    )
    assert done.returncode == 2, done.stderr
    assert done.stderr.splitlines()[-1].endswith(f"which is not installed: run `make setup-{group}`")
