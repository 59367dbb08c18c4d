"""The versions that a manifest states: those of the code and of the libraries, and nothing of the machine."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

from stages.package.versions import code_version, library_versions

ROOT = Path(__file__).resolve().parents[3]


def test_the_code_version_is_a_function_of_the_code_alone(tmp_path: Path) -> None:
    """A copy elsewhere, without history, says the same; an edited file says otherwise."""
    for name in ("pipeline", "stages"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    ask = [sys.executable, "-c", "from stages.package.versions import code_version; print(code_version(), end='')"]

    def copied() -> str:
        return subprocess.run(ask, cwd=tmp_path, capture_output=True, text=True, check=True).stdout

    assert copied() == code_version()
    with open(tmp_path / "stages" / "points" / "stage.py", "a", encoding="utf-8") as file:
        file.write("EDITED = True\n")
    assert copied() != code_version()


def test_libraries_are_those_of_the_project_with_plain_versions() -> None:
    found = library_versions()
    assert {"numpy", "trimesh", "PyYAML"} <= set(found)
    assert "torch" not in found, "the card is the same whichever groups are installed"
    assert all(re.fullmatch(r"[0-9a-z.]+", version) for version in found.values())
