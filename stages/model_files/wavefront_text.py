"""The lines of OBJ and MTL files: any white space, comments taken away, continued lines joined."""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterator
from dataclasses import dataclass

_LINE_END = re.compile(r"\r\n|\n|\r")
_COMMENT = re.compile(r"(?:^|(?<=\s))#(?!\d+\s*$)")
"""Where a comment begins. `Material #25` is a name: 3ds Max numbers materials and maps so."""


@dataclass(frozen=True)
class TextLine:
    """A line of a file.

    number: of its first line in the file, from 1.
    keyword: its first word.
    rest: what follows, without the comment, with single spaces between words.
    full: what follows, comment and spaces included, for names of files.
    """

    number: int
    keyword: str
    rest: str
    full: str

    def file_names(self) -> list[str]:
        """Return what may be the name of a file, which may hold blanks and `#`: all, up to ` # `, up to any comment."""
        return list(dict.fromkeys((self.full, re.split(r"\s#(?=\s|$)", self.full)[0], self.rest)))


def decode_wavefront_text(content: bytes) -> str:
    """Decode text as its byte order mark says, else as UTF-8, else as Windows-1252, in which every byte is a letter."""
    if content[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
        return content.decode("utf-16", errors="replace")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252", errors="replace")


def text_lines(text: str) -> Iterator[TextLine]:
    """Yield the lines that hold more than a comment."""
    parts: list[str] = []
    raws: list[str] = []
    first = 1
    for number, raw in enumerate(_LINE_END.split(text), start=1):
        line = raw
        if "#" in raw and (comment := _COMMENT.search(raw)):
            line = raw[: comment.start()]
        line = line.rstrip()
        if not parts:
            first = number
        continues = line.endswith("\\") and len(line) == len(raw.rstrip())
        parts.append(line[:-1] if continues else line)
        raws.append(raw.rstrip()[:-1] if continues else raw)
        if continues:
            continue
        yield from _line(first, " ".join(parts), " ".join(raws))
        parts, raws = [], []
    yield from _line(first, " ".join(parts), " ".join(raws))


def _line(number: int, line: str, raw: str) -> Iterator[TextLine]:
    keyword, *words = line.split() or [""]
    if keyword:
        yield TextLine(number, keyword, " ".join(words), raw.split(maxsplit=1)[1].strip() if words else "")
