"""Program files of folders and archives."""

from __future__ import annotations

import tarfile
from pathlib import Path

from stages.shapeassembly.sources import program_texts


def test_sidecars_of_macos_are_no_programs(tmp_path: Path) -> None:
    folder = tmp_path / "programs"
    folder.mkdir()
    (folder / "a.txt").write_text("Assembly", encoding="utf-8")
    (folder / "._a.txt").write_bytes(b"\x00\x05\x16\x07")
    with tarfile.open(tmp_path / "programs.tar", "w") as archive:
        archive.add(folder, "programs")
    assert list(program_texts(folder)) == [("a.txt", "Assembly")]
    assert list(program_texts(tmp_path / "programs.tar")) == [("programs/a.txt", "Assembly")]
