"""STL, ASCII and binary. The solids of an ASCII file are its objects.

trimesh's reader is not used here: it silently stops reading at the first word that is no number.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pipeline.errors import ConfigError
from stages.model_files.scene import GREY, Malformed, ModelScene, Placement, Surface
from stages.shape.arrays import FloatArray

_HEAD_BYTES, _TRIANGLE_BYTES = 84, 50
_ROW = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read_stl(path: Path) -> ModelScene:
    """Return the surfaces of a `.stl` file, one for each solid.

    Raises ConfigError for a file that is cut off or malformed, with the line if it is text.
    """
    content = path.read_bytes()
    announced = int.from_bytes(content[80:_HEAD_BYTES], "little")
    try:
        if len(content) == _HEAD_BYTES + _TRIANGLE_BYTES * announced:
            corners = np.ndarray(announced, _ROW, content, _HEAD_BYTES)["corners"]
            solids = [(path.stem, corners.reshape(-1, 3).astype(np.float64))]
        elif content.lstrip()[:5].lower() == b"solid":
            solids = _solids(content.decode("utf-8", errors="replace"), path.stem)
        else:
            raise Malformed(f"{announced} triangles are announced, the file has {len(content)} bytes")
    except Malformed as error:
        raise ConfigError(f"{path}: not a whole STL file ({error}); copy or export it again") from None
    surfaces: list[Surface] = []
    placements: list[Placement] = []
    for name, vertices in solids:
        faces = np.arange(len(vertices), dtype=np.int32).reshape(-1, 3)
        grey = np.tile(np.array(GREY, np.uint8), (len(faces), 1))
        placements.append(Placement(name, None, len(surfaces), np.eye(4)))
        surfaces.append(Surface(name, vertices, faces, grey))
    return ModelScene("objects", tuple(surfaces), tuple(placements))


def _solids(text: str, stem: str) -> list[tuple[str, FloatArray]]:
    """Return name and corners, float64 (3 * f, 3), of each solid with faces; a single solid has the file's name."""
    solids: list[tuple[str, FloatArray]] = []
    corners: list[list[float]] = []
    name: str | None = None
    for number, line in enumerate(text.splitlines(), start=1):
        keyword, *words = line.split()[:4] or [""]
        keyword = keyword.lower()
        if keyword == "vertex":
            try:
                x, y, z = (float(word) for word in words)
            except ValueError:
                raise Malformed(f"line {number}, {line.strip()[:60]!r}, is no vertex") from None
            corners.append([x, y, z])
        elif keyword == "solid":
            if name is not None:
                raise Malformed(f"line {number}: a solid begins before the last one ends")
            name = line.strip()[5:].strip()
        elif keyword == "endsolid":
            if len(corners) % 3:
                raise Malformed(f"line {number}: a solid ends within a triangle")
            if corners:
                solids.append((name or stem, np.array(corners, dtype=np.float64)))
            name, corners = None, []
    if name is not None or corners:
        raise Malformed("its last solid does not end")
    return solids if len(solids) > 1 else [(stem, corners) for _, corners in solids]
