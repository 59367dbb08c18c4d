"""STL, text and binary, with the colours in the attribute bytes. The solids of a text file are its objects.

trimesh's reader is not used here: it silently stops reading at the first word that is no number.
"""

from __future__ import annotations

import codecs
import re
from pathlib import Path

import numpy as np

from pipeline.errors import ConfigError
from stages.model_files.scene import GREY, Malformed, ModelScene, Placement, Surface, plain_text
from stages.model_files.wavefront_text import decode_wavefront_text
from stages.shape.arrays import ByteArray, FloatArray

_HEAD_BYTES, _TRIANGLE_BYTES = 84, 50
_ROW = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_TEXT_HEAD_BYTES = 1024
_UTF16_MARKS = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_OWN_COLOR_BIT = 0x8000
_CHANNEL_BITS, _CHANNEL_MAX = 5, 31
_STATEMENT = re.compile(r"(?<!\S)(?:facet|outer|vertex|endloop|endfacet|endsolid|solid|normal)(?!\S)", re.IGNORECASE)
_AFTER_SOLID = re.compile(r"(?<!\S)(?:facet\s+normal|endsolid)(?!\S)", re.IGNORECASE)
_AFTER_ENDSOLID = re.compile(r"(?<!\S)solid(?!\S)", re.IGNORECASE)


def read_stl(path: Path) -> ModelScene:
    """Return the surfaces of a `.stl` file, one for each solid.

    Raises ConfigError for a file that is cut off or malformed, with the line if it is text.
    """
    content = path.read_bytes()
    warnings: list[str] = []
    try:
        if _is_text(content):
            solids = _Text(path.stem).read(decode_wavefront_text(content), warnings)
            colors: list[ByteArray | None] = [None] * len(solids)
        else:
            corners, color = _binary(content, warnings)
            solids, colors = [(path.stem, corners)], [color]
    except Malformed as error:
        raise ConfigError(f"{path}: not a whole STL file ({error}); copy or export it again") from None
    surfaces: list[Surface] = []
    placements: list[Placement] = []
    for (name, vertices), paint in zip(solids, colors, strict=True):
        faces = np.arange(len(vertices), dtype=np.int32).reshape(-1, 3)
        face_colors = np.tile(np.array(GREY, np.uint8), (len(faces), 1)) if paint is None else paint
        placements.append(Placement(name, None, len(surfaces), np.eye(4)))
        surfaces.append(Surface(name, vertices, faces, face_colors, paint=paint))
    return ModelScene("objects", tuple(surfaces), tuple(placements), tuple(warnings))


def _is_text(content: bytes) -> bool:
    """Return whether a file is text: many binary files begin with the word that begins text files, too."""
    announced = int.from_bytes(content[80:_HEAD_BYTES], "little")
    if len(content) == _HEAD_BYTES + _TRIANGLE_BYTES * announced:
        return False
    head = content[:_TEXT_HEAD_BYTES]
    if head[:2] not in _UTF16_MARKS and b"\0" in head:
        return False
    return content.removeprefix(codecs.BOM_UTF8).lstrip()[:5].lower() == b"solid" or head[:2] in _UTF16_MARKS


def _binary(content: bytes, warnings: list[str]) -> tuple[FloatArray, ByteArray | None]:
    """Return corners, float64 (3 * f, 3), and the colours of the facets, if any has one."""
    announced = int.from_bytes(content[80:_HEAD_BYTES], "little")
    held, further = divmod(max(0, len(content) - _HEAD_BYTES), _TRIANGLE_BYTES)
    if announced == 0 and held and not further:
        warnings.append(f"the header announces no triangles; the {held:,} that follow are read")
        announced = held
    if len(content) < _HEAD_BYTES or announced > held:
        raise Malformed(f"{announced} triangles are announced, the file has {len(content)} bytes")
    rows = np.ndarray(announced, _ROW, content, _HEAD_BYTES)
    further = len(content) - _HEAD_BYTES - _TRIANGLE_BYTES * announced
    if further:
        warnings.append(f"{further:,} bytes after the last of the {announced:,} announced triangles are left out")
    return rows["corners"].reshape(-1, 3).astype(np.float64), _attribute_colors(content, rows["attribute"], warnings)


def _attribute_colors(content: bytes, attributes: np.ndarray, warnings: list[str]) -> ByteArray | None:
    """Return the colours of facets, uint8 (f, 3), from their attribute bytes: five bits a channel.

    Materialise Magics writes the colour of the whole in the header, after `COLOR=`; red is in the lowest bits, and the
    highest one marks facets without a colour of their own. VisCAM has blue in the lowest bits, and the highest one
    marks facets with a colour.
    """
    attributes = attributes.astype(np.int64)
    at = content[: _HEAD_BYTES - 4].find(b"COLOR=")
    is_magics = at >= 0 and len(content[at + 6 : at + 9]) == 3
    has_own = (attributes & _OWN_COLOR_BIT == 0) == is_magics
    channels = attributes[:, None] >> (_CHANNEL_BITS * np.array([0, 1, 2] if is_magics else [2, 1, 0])) & _CHANNEL_MAX
    own = np.rint(channels * 255 / _CHANNEL_MAX).astype(np.uint8)
    if is_magics:
        whole = np.frombuffer(content[at + 6 : at + 9], np.uint8)
        return np.where(has_own[:, None], own, whole).astype(np.uint8)
    if has_own.any():
        return np.where(has_own[:, None], own, np.array(GREY, np.uint8)).astype(np.uint8)
    if count := np.count_nonzero(attributes):
        warnings.append(f"the attribute bytes of {count:,} triangles are no colours that are known and are left out")
    return None


class _Text:
    """Read the statements of a text file, whatever lines they are on."""

    def __init__(self, stem: str) -> None:
        self.stem = stem
        self.solids: list[tuple[str, FloatArray]] = []
        self.name: str | None = None
        self.numbers: list[float] = []
        self.loop: int | None = None  # how many numbers there were when the open loop began
        self.vertex: int | None = None  # how many numbers there were when the last vertex of the loop began
        self.unknown: dict[str, list[int]] = {}

    def read(self, text: str, warnings: list[str]) -> list[tuple[str, FloatArray]]:
        """Return name and corners, float64 (3 * f, 3), of each solid with faces; a single one has the file's name.

        Raises Malformed, with the line.
        """
        for number, line in enumerate(text.splitlines(), start=1):
            rest = line.strip()
            while rest:
                statement, rest = self.split(rest)
                self.read_statement(statement, number)
        if self.name is not None or self.numbers:
            raise Malformed("its last solid does not end")
        warnings += [
            f"{len(numbers):,} statements {word!r}, the first of them in line {numbers[0]}, are left out"
            for word, numbers in self.unknown.items()
        ]
        return self.solids if len(self.solids) > 1 else [(self.stem, corners) for _, corners in self.solids]

    def split(self, line: str) -> tuple[str, str]:
        """Return the first statement of a line, and the rest. Names of solids may hold keywords."""
        keyword = line[:9].split(maxsplit=1)[0].lower()
        if keyword == "endsolid" and line[8:].strip() == self.name:
            return line, ""
        pattern = {"solid": _AFTER_SOLID, "endsolid": _AFTER_ENDSOLID}.get(keyword, _STATEMENT)
        following = pattern.search(line, len(keyword))
        return (line[: following.start()], line[following.start() :].strip()) if following else (line, "")

    def read_statement(self, statement: str, number: int) -> None:
        keyword, *words = statement.split()
        keyword = keyword.lower()
        if keyword == "vertex":
            if self.loop is None:
                raise Malformed(f"line {number}: a vertex is outside a loop")
            self.check_vertex(number)
            self.vertex = len(self.numbers)
            self.add_numbers(words, statement, number)
        elif keyword == "outer":
            if self.loop is not None:
                raise Malformed(f"line {number}: a loop begins before the last one ends")
            self.loop = len(self.numbers)
        elif keyword == "endloop":
            self.check_vertex(number)
            if self.loop is None or len(self.numbers) - self.loop != 9:
                count = 0 if self.loop is None else (len(self.numbers) - self.loop) // 3
                raise Malformed(f"line {number}: a facet has {count} vertices, and STL holds triangles only")
            self.loop = self.vertex = None
        elif keyword == "solid":
            if self.name is not None:
                raise Malformed(f"line {number}: a solid begins before the last one ends")
            self.name = statement[5:].strip()
        elif keyword == "endsolid":
            if self.loop is not None:
                raise Malformed(f"line {number}: a solid ends within a triangle")
            if self.numbers:
                self.solids.append((self.name or self.stem, np.array(self.numbers, dtype=np.float64).reshape(-1, 3)))
            self.name, self.numbers = None, []
        elif self.vertex is not None and len(self.numbers) - self.vertex < 3:
            self.add_numbers([keyword, *words], statement, number)
        elif keyword not in ("facet", "endfacet", "normal") and (self.vertex is not None or not _is_number(keyword)):
            self.unknown.setdefault(plain_text(keyword[:40]), []).append(number)

    def add_numbers(self, words: list[str], statement: str, number: int) -> None:
        try:
            self.numbers += [float(word) for word in words]
        except ValueError:
            raise Malformed(f"line {number}, {statement[:60]!r}, is no vertex") from None

    def check_vertex(self, number: int) -> None:
        """Raise Malformed unless the last vertex has three numbers."""
        if self.vertex is not None and len(self.numbers) - self.vertex != 3:
            raise Malformed(f"line {number}: the vertex before it has not three numbers")


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
