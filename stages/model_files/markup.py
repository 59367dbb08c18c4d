"""Check the XML of a COLLADA file before pycollada reads it.

pycollada would open an archive and follow entities, to any depth, and allocate arrays of any announced length.
"""

from __future__ import annotations

from pathlib import Path
from xml.parsers import expat

from pipeline.errors import ConfigError

_MAX_DEPTH = 250


def check_markup(path: Path, content: bytes) -> None:
    """Check the XML of a COLLADA file, in any encoding.

    Raises ConfigError for a file that is no plain XML, declares entities, nests deeper than 250 elements, or announces
    polygons of more corners than the file has bytes.
    """
    checker = _Checker(path, len(content))
    try:
        checker.parser.Parse(content, True)
    except expat.ExpatError as error:
        where = f"line {error.lineno}, column {error.offset + 1}"
        raise ConfigError(f"{path}: not a whole COLLADA file ({where} is no XML); copy or export it again") from None
    except (LookupError, ValueError):
        raise ConfigError(f"{path}: not a whole COLLADA file (its encoding is unknown); export it as UTF-8") from None


class _Checker:
    def __init__(self, path: Path, size: int) -> None:
        self.path = path
        self.size = size
        self.depth = 0
        self.counts: list[str] = []
        self.parser = expat.ParserCreate()
        self.parser.buffer_text = True
        self.parser.StartDoctypeDeclHandler = self.declare
        self.parser.StartElementHandler = self.enter
        self.parser.EndElementHandler = self.leave

    def declare(self, *_: object) -> None:
        raise ConfigError(f"{self.path}: declares XML entities, which are not read; export it again as plain COLLADA")

    def enter(self, name: str, _: object) -> None:
        self.depth += 1
        if self.depth > _MAX_DEPTH:
            raise ConfigError(
                f"{self.path}: its elements nest deeper than {_MAX_DEPTH}, at <{name}>; export it flatter"
            )
        if name == "vcount":
            self.parser.CharacterDataHandler = self.counts.append

    def leave(self, name: str) -> None:
        self.depth -= 1
        if name == "vcount":
            self.parser.CharacterDataHandler = None
            words, self.counts = "".join(self.counts).split(), []
            if any(len(word) > 9 for word in words) or sum(int(word) for word in words if word.isdecimal()) > self.size:
                raise ConfigError(
                    f"{self.path}: <vcount> in line {self.parser.CurrentLineNumber} announces more corners than the "
                    "file can hold; export it again"
                )
