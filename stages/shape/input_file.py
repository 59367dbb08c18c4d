"""Files that a person gives to any reader: told by their first bytes, before a parser sees them."""

from __future__ import annotations

import contextlib
import difflib
import os
import re
from collections.abc import Iterable
from pathlib import Path

from pipeline.errors import ConfigError

FIRST_BYTES = 4096
"""Bytes of a file that tell what it is."""

_LFS_POINTER = re.compile(rb"version https?://(git-lfs\.github\.com|hawser\.github\.com)/spec/")
_LFS_SIZE = re.compile(rb"^size (\d{1,18})\s*$", re.MULTILINE)
_ANNEX_POINTER = re.compile(rb"[./]*(\.git/)?annex/objects/")
_MARKUP_PREFIX = re.compile(rb"(\xef\xbb\xbf)?(\s+|<\?xml[^>]*>|<!--.*?-->)*", re.DOTALL)
_WEB_PAGE = re.compile(rb"<(!doctype\s+html|html|head|body|title|meta|script|div|center|h1|p)\b", re.IGNORECASE)
_SERVER_ERROR = re.compile(rb"<Error>\s*<Code>")

_PACKED = {
    "gzip": (re.compile(rb"\x1f\x8b"), "gunzip"),
    "zip": (re.compile(rb"PK(\x03\x04|\x05\x06)"), "unzip"),
    "bzip2": (re.compile(rb"BZh[1-9](1AY&SY|\x17rE8P\x90)"), "bunzip2"),
    "xz": (re.compile(rb"\xfd7zXZ\0"), "unxz"),
    "zstd": (re.compile(rb"\x28\xb5\x2f\xfd"), "unzstd"),
    "7z": (re.compile(rb"7z\xbc\xaf\x27\x1c"), "7z x"),
    "rar": (re.compile(rb"Rar!\x1a\x07"), "unrar x"),
}
"""First bytes of compressed files and archives, and the command that unpacks them."""

_APPLE_DOUBLE = b"\x00\x05\x16\x07"
_TAR_MAGIC = slice(257, 262)


def check_input_file(path: Path, packed: str = "") -> None:
    """Refuse what no reader of models, clouds or pictures can read.

    packed: the archive that the format itself is, `zip` for .npz files.

    Raises ConfigError, with the remedy, for a missing file (with the nearest name), a folder, a file without
    permission, an empty one, a Git LFS or git-annex pointer, a web page, an archive, and a file of zero bytes only.
    """
    check_exists(path)
    if not path.is_file():
        raise ConfigError(f"{path}: is {'a folder' if path.is_dir() else 'no regular file'}; name one file")
    try:
        with open(path, "rb") as stream:
            first = stream.read(FIRST_BYTES)
    except PermissionError:
        raise ConfigError(f"{path}: may not be read; give this user permission to read it (chmod u+r)") from None
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror or error}") from None
    check_first_bytes(str(path), first, packed)


def check_first_bytes(name: str, first: bytes, packed: str = "") -> None:
    """Refuse a content by its first bytes, as `check_input_file` does. Raises ConfigError that begins with `name`."""
    fault = content_fault(first, packed)
    if not first:
        fault = "the file is empty; copy or export it again"
    elif not first.strip(b"\0"):
        fault = "holds zero bytes only, as a broken download does; download or copy it again"
    if fault:
        raise ConfigError(f"{name}: {fault}")


def check_exists(path: Path) -> None:
    """Raise ConfigError, with the nearest name, for a file that does not exist."""
    if not os.access(path, os.F_OK):  # Path.exists() raises where a folder on the way may not be entered
        neighbours: list[str] = []
        with contextlib.suppress(OSError):
            neighbours = [file.name for file in path.parent.iterdir()]
        near = difflib.get_close_matches(path.name, neighbours, n=1)
        raise ConfigError(f"{path}: no such file" + (f"; did you mean {near[0]}?" if near else ""))


def is_sidecar(path: Path) -> bool:
    """Return whether a path is a `._name` file, which macOS puts next to each file on disks of other systems."""
    return path.name.startswith("._")


def without_sidecars(files: Iterable[Path]) -> tuple[list[Path], int]:
    """Return the files of a folder without sidecars, and the number of those."""
    listed = list(files)
    kept = [file for file in listed if not is_sidecar(file)]
    return kept, len(listed) - len(kept)


def decode_text(content: bytes) -> str:
    """Return the text of a file in UTF-8, or in UTF-16 or UTF-32 with or without byte order mark, without the mark.

    Bytes that are not valid become U+FFFD.
    """
    if content.startswith((b"\xff\xfe\0\0", b"\0\0\xfe\xff")):
        return content.decode("utf-32", errors="replace")
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        return content.decode("utf-16", errors="replace")
    odd, even = content[1:FIRST_BYTES:2], content[0:FIRST_BYTES:2]
    if len(odd) > 1 and odd.count(0) > 0.9 * len(odd) and even.count(0) == 0:
        return content.decode("utf-16-le", errors="replace")
    if len(odd) > 1 and even.count(0) > 0.9 * len(even) and odd.count(0) == 0:
        return content.decode("utf-16-be", errors="replace")
    return content.decode("utf-8-sig", errors="replace")


def content_fault(content: bytes, packed: str = "") -> str:
    """Return what a file is instead of data, as the end of a sentence with the remedy; empty for data.

    content: the bytes of the file, or its first FIRST_BYTES; packed: as in `check_input_file`.
    """
    first = content[:FIRST_BYTES]
    if _LFS_POINTER.match(first.lstrip()):
        size = _LFS_SIZE.search(first)
        stored = f" to {int(size[1]):,} bytes" if size else ""
        return f"is a Git LFS pointer{stored}, not the file itself; run `git lfs pull` in its repository"
    if _ANNEX_POINTER.match(first):
        return "is a git-annex pointer, not the file itself; run `git annex get` in its repository"
    prefix = _MARKUP_PREFIX.match(first)
    markup = first[prefix.end() :] if prefix else first
    if _WEB_PAGE.match(markup):
        return (
            "is a web page (HTML), not the file itself: its address leads to a page about it, or to a login; "
            "download the raw file"
        )
    if _SERVER_ERROR.match(markup):
        return "is the error message of a server (XML), not the file itself; download it again"
    for name, (magic, command) in _PACKED.items():
        if magic.match(first) and name != packed:
            return f"is packed ({name}); unpack it (`{command} FILE`) and name a file in it"
    if first[_TAR_MAGIC] == b"ustar":
        return "is a tar archive; unpack it (`tar xf FILE`) and name a file in it"
    if first.startswith(_APPLE_DOUBLE):
        return "is what macOS notes about a file (AppleDouble), without its content; name the file without `._`"
    return ""
