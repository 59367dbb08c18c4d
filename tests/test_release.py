"""Changelog fragments are checked, joined and tagged."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


def git(folder: Path, *arguments: str) -> str:
    identity = ("-c", "user.name=Jane Doe", "-c", "user.email=jane@example.org")
    return subprocess.run(["git", *identity, *arguments], cwd=folder, check=True, capture_output=True, text=True).stdout


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A repository with the release script, a changelog of one release and no fragments."""
    shutil.copytree(ROOT / "changes", tmp_path / "changes", ignore=shutil.ignore_patterns("*.*.md", "__pycache__"))
    (tmp_path / "CHANGELOG.md").write_text(
        "# Changelog\n\n## 0.1.0 (2026-01-01)\n\nData format: 1.0.\n", encoding="utf-8"
    )
    (tmp_path / "pyproject.toml").write_text('[project]\nname = "shapemill"\nversion = "0.1.0"\n', encoding="utf-8")
    git(tmp_path, "init", "-q")
    git(tmp_path, "config", "user.name", "Jane Doe")
    git(tmp_path, "config", "user.email", "jane@example.org")
    return tmp_path


def release(project: Path, version: str) -> subprocess.CompletedProcess[str]:
    git(project, "add", "-A")
    git(project, "commit", "-q", "--allow-empty", "-m", "state")
    command = [sys.executable, "changes/release.py", version]
    return subprocess.run(command, cwd=project, capture_output=True, text=True)


def test_release_joins_fragments_sets_the_version_and_tags(project: Path) -> None:
    (project / "changes/sketches.added.md").write_text("Sketches have a second pen.\n", encoding="utf-8")
    (project / "changes/reader.fixed.md").write_text(
        "OBJ comments are read.\nSTL text is read by tokens.\n", encoding="utf-8"
    )
    (project / "changes/record.data-format.md").write_text("records 1.1: field `pen` added.\n", encoding="utf-8")
    assert release(project, "0.2.0").returncode == 0
    changelog = (project / "CHANGELOG.md").read_text(encoding="utf-8")
    assert changelog.index("## 0.2.0 (") < changelog.index("## 0.1.0 (")
    assert "Data format: records 1.1: field `pen` added." in changelog
    assert "### Added\n\n- Sketches have a second pen.\n" in changelog
    assert "### Fixed\n\n- OBJ comments are read.\n- STL text is read by tokens.\n" in changelog
    assert 'version = "0.2.0"' in (project / "pyproject.toml").read_text(encoding="utf-8")
    assert [path.name for path in (project / "changes").glob("*.md")] == ["README.md"]
    assert git(project, "tag").split() == ["v0.2.0"]
    assert git(project, "status", "--porcelain") == ""


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("sketches.md", "No kind.\n"),
        ("sketches.new.md", "Unknown kind.\n"),
        ("sketches.added.md", "- A bullet.\n"),
        ("sketches.added.md", "x" * 121 + "\n"),
    ],
)
def test_malformed_fragment_stops_the_release_before_anything_changes(project: Path, name: str, text: str) -> None:
    (project / "changes" / name).write_text(text, encoding="utf-8")
    result = release(project, "0.2.0")
    assert result.returncode == 2
    assert name in result.stderr
    assert git(project, "tag") == git(project, "status", "--porcelain") == ""


def test_uncommitted_changes_and_existing_versions_are_refused(project: Path) -> None:
    assert release(project, "0.1.0").returncode == 2
    (project / "pyproject.toml").write_text("edited\n", encoding="utf-8")
    command = [sys.executable, "changes/release.py", "0.2.0"]
    result = subprocess.run(command, cwd=project, capture_output=True, text=True)
    assert result.returncode == 2
    assert "not committed" in result.stderr


def test_fragments_of_this_project_are_well_formed() -> None:
    subprocess.run([sys.executable, "changes/release.py", "--check"], cwd=ROOT, check=True)
