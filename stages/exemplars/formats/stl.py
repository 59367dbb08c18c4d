"""STL, ASCII and binary, through trimesh. The solids of an ASCII file are its objects."""

from __future__ import annotations

import io
import re
from pathlib import Path

import numpy as np

from pipeline.errors import ConfigError
from stages.exemplars.formats.scene import GREY, Placement, Scene, Surface

__all__ = ["read_stl"]


def read_stl(path: Path) -> Scene:
    """The surfaces of a `.stl` file, one for each solid. Raises ConfigError for a file that is cut off."""
    import trimesh

    content = path.read_bytes()
    announced = int.from_bytes(content[80:84], "little")
    if len(content) != 84 + 50 * announced:
        opened, ended = (len(re.findall(rb"^\s*%s\b" % word, content, re.M | re.I)) for word in (b"solid", b"endsolid"))
        if not opened:
            raise _cut_off(path, f"{announced} triangles are announced, the file has {len(content)} bytes")
        if ended < opened:
            raise _cut_off(path, "its last solid does not end")
    try:
        scene = trimesh.load_scene(io.BytesIO(content), file_type="stl", process=False)
    except Exception as error:
        raise _cut_off(path, str(error)) from None
    surfaces: list[Surface] = []
    placements: list[Placement] = []
    for name, mesh in scene.geometry.items():
        faces = np.asarray(mesh.faces, dtype=np.int32).reshape(-1, 3)
        grey = np.tile(np.array(GREY, np.uint8), (len(faces), 1))
        title = name if len(scene.geometry) > 1 and name else path.stem
        placements.append(Placement(title, None, len(surfaces), np.eye(4)))
        surfaces.append(Surface(title, np.asarray(mesh.vertices, dtype=np.float64), faces, grey))
    return Scene("objects", tuple(surfaces), tuple(placements))


def _cut_off(path: Path, reason: str) -> ConfigError:
    return ConfigError(f"{path}: not a whole STL file ({reason}); copy or export it again")
