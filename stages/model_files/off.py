"""OFF, with face colours and vertex colours (COFF). trimesh's reader leaves out both."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pipeline.errors import ConfigError
from stages.model_files.colors import color_bytes, face_paint
from stages.model_files.polygons import triangulate
from stages.model_files.scene import GREY, INVALID, Malformed, ModelScene, Placement, Surface
from stages.shape.arrays import ByteArray


def read_off(path: Path) -> ModelScene:
    """Return the surface of an ASCII `.off` file. Raises ConfigError for a file that is cut off or malformed."""
    try:
        surface = _parse(path.read_bytes().decode("utf-8", errors="replace"), path.stem)
    except (ArithmeticError, LookupError, ValueError) as error:
        reason = error if isinstance(error, Malformed) else f"its count of vertices and faces, or a colour, {INVALID}"
        raise ConfigError(f"{path}: not a whole ASCII OFF file ({reason}); copy or export it again") from None
    return ModelScene("objects", (surface,), (Placement(path.stem, None, 0, np.eye(4)),))


def _parse(text: str, name: str) -> Surface:
    lines = [words for line in text.splitlines() if (words := line.partition("#")[0].split())]
    if not lines or lines[0][0] not in ("OFF", "COFF", "NOFF", "CNOFF"):
        raise Malformed("the first line must be OFF or COFF")
    kind = lines[0].pop(0)
    if not lines[0]:
        del lines[0]
    vertex_count, face_count = (int(word) for word in lines[0][:2])
    if min(vertex_count, face_count) < 0 or len(lines) < 1 + vertex_count + face_count:
        raise Malformed(f"{vertex_count} vertices and {face_count} faces are announced, {len(lines) - 1} lines follow")
    rows = lines[1 : 1 + vertex_count]
    vertices = np.array([_point(row) for row in rows], dtype=np.float64).reshape(-1, 3)
    corners: list[int] = []
    counts: list[int] = []
    colors: list[ByteArray | None] = []
    for row in lines[1 + vertex_count : 1 + vertex_count + face_count]:
        try:
            count, *indices = (int(word) for word in row[: 1 + max(0, int(row[0]))])
        except ValueError:
            raise Malformed(f"face {' '.join(row)[:40]!r} is not made of whole numbers") from None
        if len(indices) != count or any(not 0 <= index < vertex_count for index in indices):
            raise Malformed(f"face {' '.join(row)[:40]!r} has other corners than {vertex_count} vertices")
        corners += indices
        counts.append(count)
        colors.append(_color(row[1 + count :]))
    triangles, polygon = triangulate(vertices, np.array(corners, np.int64), np.array(counts, np.int64))
    faces = np.array(corners, np.int64)[triangles].astype(np.int32)
    paint = None
    if any(color is not None for color in colors):
        paint = np.array([GREY if color is None else color for color in colors], dtype=np.uint8)[polygon]
    elif kind in ("COFF", "CNOFF"):
        of_vertices = [_color(row[6:] if kind == "CNOFF" else row[3:]) for row in rows]
        paint = face_paint(np.array([GREY if color is None else color for color in of_vertices], np.uint8), faces)
    grey = np.tile(np.array(GREY, np.uint8), (len(faces), 1))
    return Surface(name, vertices, faces, grey if paint is None else paint, paint=paint)


def _point(words: list[str]) -> list[float]:
    try:
        x, y, z = (float(word) for word in words[:3])
    except ValueError:
        raise Malformed(f"vertex {' '.join(words)[:40]!r} is not three numbers") from None
    return [x, y, z]


def _color(words: list[str]) -> ByteArray | None:
    """Return the colour after a vertex or a face, whole numbers to 255 or fractions; None for fewer than three."""
    if len(words) < 3:
        return None
    if all(word.lstrip("+").isdigit() for word in words):
        return np.array([min(int(word), 255) for word in words[:3]], dtype=np.uint8)
    return color_bytes(np.array([float(word) for word in words[:3]]))
