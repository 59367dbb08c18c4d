"""Read programs from folders and archives of text files. Nothing is unpacked, no link is followed."""

from __future__ import annotations

import hashlib
import tarfile
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

from pipeline.paths import file_digest
from stages.shape.input_file import is_sidecar
from stages.shapeassembly.syntax.limits import MAX_TEXT_CHARACTERS


def existing_programs(path: Path) -> Path:
    """Return the path. Raises ValueError where it is neither a folder nor a tar archive."""
    if path.is_dir() or (path.is_file() and tarfile.is_tarfile(path)):
        return path
    if path.exists():
        raise ValueError(f"{path} is neither a folder nor a tar archive")
    raise ValueError(f"there is no folder and no file {path}")


def program_texts(path: Path, folder: str = "") -> Iterator[tuple[str, str]]:
    """Yield name below `path` and text of every `.txt` file, sorted by name, without the `._` files of macOS.

    Invalid UTF-8 is replaced and overlong files are cut, so that the parser rejects them.
    folder: only files below this folder.
    """
    if path.is_dir():
        for name, file in _text_files(path):
            if _below(name, folder):
                with open(file, "rb") as stream:
                    yield name, stream.read(MAX_TEXT_CHARACTERS + 1).decode(errors="replace")
        return
    with tarfile.open(path) as archive:
        members = {
            entry.name: entry
            for entry in archive.getmembers()
            if _is_program(Path(entry.name)) and entry.isfile() and _below(entry.name, folder)
        }
        texts = {}
        # A compressed archive is read in its own order.
        for name, member in members.items():
            stored = archive.extractfile(member)
            assert stored is not None
            texts[name] = stored.read(MAX_TEXT_CHARACTERS + 1).decode(errors="replace")
    yield from sorted(texts.items())


def names_of_list(path: Path, name: str) -> list[str]:
    """Return the lines of a `.txt` list below `path`, without empty ones. Raises KeyError where it does not exist."""
    lists = dict(program_texts(path, name.rpartition("/")[0]))
    return lists[name].split()


def _is_program(path: Path) -> bool:
    return path.suffix == ".txt" and not is_sidecar(path)


def _below(name: str, folder: str) -> bool:
    return not folder or name.startswith(f"{folder.strip('/')}/")


def source_digest(path: Path) -> str:
    """Return the hex sha256 of an archive, or of the names and bytes of all `.txt` files of a folder."""
    if path.is_file():
        return cached_digest(path)
    digest = hashlib.sha256()
    for name, file in _text_files(path):
        digest.update(f"{name}\0{cached_digest(file)}\n".encode())
    return digest.hexdigest()


def _text_files(path: Path) -> list[tuple[str, Path]]:
    files = [file for file in path.rglob("*.txt") if _is_program(file) and file.is_file() and not file.is_symlink()]
    return sorted((file.relative_to(path).as_posix(), file) for file in files)


def cached_digest(file: Path) -> str:
    """Return the sha256 of a file, computed once for each state of it: plans are computed often."""
    state = file.stat()
    return _digest_of_state(file, state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=65536)
def _digest_of_state(file: Path, modified: int, size: int) -> str:
    return file_digest(file)
