"""OFF, as text: polygons, face colours and vertex colours. trimesh's reader leaves out the colours."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pipeline.errors import ConfigError
from stages.model_files.colors import color_bytes, face_paint, unit_colors
from stages.model_files.polygons import triangulate
from stages.model_files.scene import GREY, INVALID, Malformed, ModelScene, Placement, Surface
from stages.model_files.wavefront_text import decode_wavefront_text
from stages.shape.arrays import ByteArray

_HEADER = re.compile(r"(ST)?(C)?(N)?(4)?(n)?OFF(?=[\s\d]|$)")
"""Texture coordinates, colours, normals, weights and a stated dimension; ModelNet40 writes the first count after it."""


def read_off(path: Path) -> ModelScene:
    """Return the surface of an ASCII `.off` file. Raises ConfigError for a file that is cut off or malformed."""
    warnings: list[str] = []
    try:
        surface = _parse(decode_wavefront_text(path.read_bytes()), path.stem, warnings)
    except (ArithmeticError, LookupError, ValueError) as error:
        reason = error if isinstance(error, Malformed) else f"its count of vertices and faces, or a colour, {INVALID}"
        raise ConfigError(f"{path}: not a whole ASCII OFF file ({reason}); copy or export it again") from None
    return ModelScene("objects", (surface,), (Placement(path.stem, None, 0, np.eye(4)),), tuple(warnings))


def _parse(text: str, name: str, warnings: list[str]) -> Surface:
    header, lines = _header([words for line in text.splitlines() if (words := line.partition("#")[0].split())])
    has_texture, has_color, has_normal, has_weight, has_dimension = map(bool, header)
    if lines[0][:1] == ["BINARY"]:
        raise Malformed("it is binary OFF, which is not read")
    if has_dimension and lines.pop(0) != ["3"]:
        raise Malformed("it states another dimension than 3")
    vertex_count, face_count = (int(word) for word in lines[0][:2])
    if min(vertex_count, face_count) < 0 or len(lines) < 1 + vertex_count + face_count:
        raise Malformed(f"{vertex_count} vertices and {face_count} faces are announced, {len(lines) - 1} lines follow")
    if further := len(lines) - 1 - vertex_count - face_count:
        warnings.append(f"{further:,} lines after the last face are left out")
    rows = lines[1 : 1 + vertex_count]
    vertices = np.array([_point(row, has_weight) for row in rows], dtype=np.float64).reshape(-1, 3)
    corners: list[int] = []
    counts: list[int] = []
    of_faces: list[Sequence[str]] = []
    for row in lines[1 + vertex_count : 1 + vertex_count + face_count]:
        try:
            count, *indices = (int(word) for word in row[: 1 + max(0, int(row[0]))])
        except ValueError:
            raise Malformed(f"face {' '.join(row)[:40]!r} is not made of whole numbers") from None
        if len(indices) != count or any(not 0 <= index < vertex_count for index in indices):
            raise Malformed(f"face {' '.join(row)[:40]!r} has other corners than {vertex_count} vertices")
        corners += indices
        counts.append(count)
        of_faces.append(row[1 + count :])
    if few := sum(count < 3 for count in counts):
        warnings.append(f"{few:,} faces with fewer than three corners are left out")
    triangles, polygon = triangulate(vertices, np.array(corners, np.int64), np.array(counts, np.int64))
    faces = np.array(corners, np.int64)[triangles].astype(np.int32)
    first = 3 + has_weight + 3 * has_normal
    last = -2 if has_texture else None
    of_vertices = [row[first:last] for row in rows] if has_color or not has_texture | has_normal else []
    face_colors, vertex_colors = _colors(of_faces, "faces", warnings), _colors(of_vertices, "vertices", warnings)
    paint = None
    if face_colors is not None:
        paint = face_colors[polygon]
    elif vertex_colors is not None:
        paint = face_paint(vertex_colors, faces)
    grey = np.tile(np.array(GREY, np.uint8), (len(faces), 1))
    return Surface(name, vertices, faces, grey if paint is None else paint, paint=paint)


def _header(lines: list[list[str]]) -> tuple[Sequence[str | None], list[list[str]]]:
    """Return the letters before OFF, and the lines that begin with the counts; the header may be missing."""
    if not lines:
        raise Malformed("it holds no line")
    found = _HEADER.match(lines[0][0]) or _HEADER.match(lines[0][0].upper())
    if found is None and not lines[0][0].isdecimal():
        raise Malformed("the first line must be OFF or COFF")
    if found is None:
        return (None,) * 5, lines
    words = [word for word in (lines[0][0][found.end() :], *lines[0][1:]) if word]
    following = [words, *lines[1:]] if words else lines[1:]
    if not following:
        raise Malformed("no count of vertices and faces follows")
    return found.groups(), following


def _point(words: list[str], has_weight: bool) -> list[float]:
    try:
        x, y, z, *more = (float(word) for word in words[: 3 + has_weight])
    except ValueError:
        raise Malformed(f"vertex {' '.join(words)[:40]!r} is not three numbers") from None
    if has_weight:
        if not more or more[0] == 0.0:
            raise Malformed(f"vertex {' '.join(words)[:40]!r} has no weight, or is at infinity")
        return [x / more[0], y / more[0], z / more[0]]
    return [x, y, z]


def _colors(rows: Sequence[Sequence[str]], kind: str, warnings: list[str]) -> ByteArray | None:
    """Return the colours after vertices or faces, grey where one is missing; None, with a warning, for other numbers.

    The whole numbers range to 255 if one of them exceeds 1, else to 1, and so do the fractions.
    """
    known = [number for number, row in enumerate(rows) if len(row) in (3, 4)]
    if others := sum(len(row) not in (0, 3, 4) for row in rows):
        warnings.append(f"what follows {others:,} {kind} is not red, green and blue, and is left out")
    if not known:
        return None
    colors = np.tile(np.array(GREY, np.uint8), (len(rows), 1))
    is_whole = [all(word.lstrip("+").isdecimal() for word in rows[number][:3]) for number in known]
    for kind_of_number in (True, False):
        same = [number for number, whole in zip(known, is_whole, strict=True) if whole == kind_of_number]
        values = np.array([[float(word) for word in rows[number][:3]] for number in same]).reshape(-1, 3)
        colors[same] = color_bytes(unit_colors(values))
    return colors
