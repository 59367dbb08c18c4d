"""Files that a command was asked for: complete, or missing with an explanation."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.errors import ConfigError
from pipeline.paths import DatasetPaths, write_file


def test_a_file_comes_with_its_folders_and_its_path(tmp_path: Path) -> None:
    path = tmp_path / "some" / "where" / "a.txt"
    assert write_file(path, b"first") == path
    assert path.read_bytes() == b"first"


def test_reader_of_the_old_file_gets_all_of_it(tmp_path: Path) -> None:
    path = write_file(tmp_path / "a.txt", b"first")
    with path.open("rb") as stream:
        write_file(path, b"second")
        assert stream.read() == b"first"
    assert path.read_bytes() == b"second"


@pytest.mark.parametrize("name", ["folder", "file/a.txt"])
def test_a_file_that_cannot_be_written_is_named_and_leaves_nothing(tmp_path: Path, name: str) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").touch()
    with pytest.raises(ConfigError, match=f"{name}: cannot be written there: "):
        write_file(tmp_path / name, b"x")
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["file", "folder"]


@pytest.mark.parametrize("file", ["", "/etc/passwd", "../other/file", "a/../b", "a//b", ".work/a/file", "./a"])
def test_published_files_are_searched_only_below_the_output_folder(file: str, tmp_path: Path) -> None:
    places = DatasetPaths(tmp_path, "one")
    assert places.published("other-models/a/weights") == tmp_path / "other-models/a/weights"
    with pytest.raises(ValueError, match="no file below the output folder"):
        places.published(file)


def test_trial_finds_files_published_in_the_output_folder(tmp_path: Path) -> None:
    assert DatasetPaths(tmp_path / "trial", "one", tmp_path).published("other/file") == tmp_path / "other/file"
