"""Files that are no model whatever they are called, told by their first bytes."""

from __future__ import annotations

import re

HEAD_BYTES = 512
"""Bytes at the beginning of a file that tell what it is."""

_ARCHIVES = {
    b"\x1f\x8b": "gzip",
    b"PK\x03\x04": "zip",
    b"BZh": "bzip2",
    b"\xfd7zXZ\0": "xz",
    b"7z\xbc\xaf\x27\x1c": "7z",
    b"Rar!": "rar",
    b"\x28\xb5\x2f\xfd": "zstd",
}
_PAGE = re.compile(rb"<(!doctype\s+html|html|head|body)\b", re.IGNORECASE)


def content_fault(content: bytes) -> str | None:
    """Return what a file is instead of data, as the end of a sentence about it with the remedy; None for data.

    content: the file's bytes, or its first HEAD_BYTES.
    """
    head = content[:HEAD_BYTES].removeprefix(b"\xef\xbb\xbf").lstrip()
    if head.startswith(b"version https://git-lfs.github.com/"):
        return "is a Git LFS pointer, not the file itself; run `git lfs pull` in its repository"
    if _PAGE.match(head):
        return "is an HTML page, not the file itself; download it again, by the link of the raw file"
    if content.startswith(b"\0\x05\x16\x07"):
        return "holds what macOS notes about a file (AppleDouble), not the file itself; name the file without `._`"
    for start, kind in _ARCHIVES.items():
        if content.startswith(start):
            return f"is compressed ({kind}); unpack it and name the file in it"
    return None
