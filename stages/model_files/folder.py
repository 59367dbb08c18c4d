"""The model files of a folder."""

from __future__ import annotations

from pathlib import Path

from stages.model_files.scene_file import READERS
from stages.shape.input_file import without_sidecars


def model_files(folder: Path) -> list[Path]:
    """Return all model files below a folder, sorted by path. Links and the `._` files of macOS are left out."""
    found = (file for file in folder.rglob("*") if file.suffix.lower() in READERS)
    files, _ = without_sidecars([file for file in found if file.is_file() and not file.is_symlink()])
    return sorted(files)
