"""Where programs are read from: folders and archives of text files. Nothing is unpacked, no link is followed."""

from __future__ import annotations

import hashlib
import tarfile
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

from pipeline.paths import file_digest
from stages.shapeassembly.syntax.limits import MAX_TEXT_CHARACTERS


def existing_programs(path: Path) -> Path:
    """`path` itself. Raises ValueError when it is neither a folder nor a tar archive."""
    if path.is_dir() or (path.is_file() and tarfile.is_tarfile(path)):
        return path
    if path.exists():
        raise ValueError(f"{path} is neither a folder nor a tar archive")
    raise ValueError(f"there is no folder and no file {path}")


def program_texts(path: Path, folder: str = "") -> Iterator[tuple[str, str]]:
    """The name below `path` and the text of every `.txt` file, in the order of the names.

    A file that is no UTF-8, or longer than a program may be, comes with its bad bytes replaced, or its start, so that
    whoever parses it refuses it. folder: only files below this folder.
    """
    if path.is_dir():
        files = [each for each in path.rglob("*.txt") if each.is_file() and not each.is_symlink()]
        for name, file in sorted((each.relative_to(path).as_posix(), each) for each in files):
            if _below(name, folder):
                with open(file, "rb") as stream:
                    yield name, stream.read(MAX_TEXT_CHARACTERS + 1).decode(errors="replace")
        return
    with tarfile.open(path) as archive:
        members = {
            each.name: each
            for each in archive.getmembers()
            if each.isfile() and each.name.endswith(".txt") and _below(each.name, folder)
        }
        texts = {}
        # In the order of the archive, which a compressed one is read in; then by name.
        for name, member in members.items():
            stored = archive.extractfile(member)
            assert stored is not None
            texts[name] = stored.read(MAX_TEXT_CHARACTERS + 1).decode(errors="replace")
    yield from sorted(texts.items())


def listed_names(path: Path, name: str) -> list[str]:
    """The lines of the list called `name` below `path`, without those that are empty. Raises KeyError where there is no
    such `.txt` file."""
    lists = dict(program_texts(path, name.rpartition("/")[0]))
    return lists[name].split()


def _below(name: str, folder: str) -> bool:
    return not folder or name.startswith(f"{folder.strip('/')}/")


def source_digest(path: Path) -> str:
    """Hex sha256 of an archive, or of the names and bytes of all `.txt` files of a folder."""
    if path.is_file():
        return _known_digest(path, path.stat().st_mtime_ns, path.stat().st_size)
    digest = hashlib.sha256()
    files = [each for each in path.rglob("*.txt") if each.is_file() and not each.is_symlink()]
    for name, file in sorted((each.relative_to(path).as_posix(), each) for each in files):
        state = file.stat()
        digest.update(f"{name}\0{_known_digest(file, state.st_mtime_ns, state.st_size)}\n".encode())
    return digest.hexdigest()


@lru_cache(maxsize=65536)
def _known_digest(file: Path, modified: int, size: int) -> str:
    """`file_digest`, asked once for each state of a file: a plan is made often."""
    return file_digest(file)
