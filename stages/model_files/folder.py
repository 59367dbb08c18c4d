"""The model files of a folder, and paths of models in an argument."""

from __future__ import annotations

from pathlib import Path

from stages.model_files.scene_file import READERS
from stages.shape.input_file import without_sidecars


def model_files(folder: Path) -> list[Path]:
    """Return all model files below a folder, sorted by path. Links and the `._` files of macOS are left out."""
    found = (file for file in folder.rglob("*") if file.suffix.lower() in READERS)
    files, _ = without_sidecars([file for file in found if file.is_file() and not file.is_symlink()])
    return sorted(files)


def model_paths(text: str) -> list[Path]:
    """Return the paths that one argument names: a path, or several with spaces between, as in MESH="a.glb folder/"."""
    several = [Path(word) for word in text.split()]
    if Path(text).exists() or not all(path.suffix.lower() in READERS or path.exists() for path in several):
        return [Path(text)]
    return several
