"""Wavefront OBJ with its MTL: named objects in file order, n-gons, materials, textures, vertex colours.

trimesh's reader is not used here: it groups faces by material, which breaks up objects and their order. It also reads
one material library only, counts negative indices from the end of the file, and splits n-gons into fans.
"""

from __future__ import annotations

import codecs
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from pipeline.errors import ConfigError
from stages.model_files.colors import color_bytes, decode_image, face_paint, sample_texture
from stages.model_files.enclosure import Enclosure, Outside
from stages.model_files.polygons import triangulate
from stages.model_files.scene import GREY, ModelScene, Placement, Surface, type_label
from stages.shape.arrays import ByteArray

_MAP_OPTIONS = {"-mm": 2, "-o": 3, "-s": 3, "-t": 3}


@dataclass
class _Material:
    color: ByteArray = field(default_factory=lambda: np.array(GREY, np.uint8))
    image: ByteArray | None = None


@dataclass
class _Lines:
    """The content of the lines of an OBJ, before triangulation."""

    positions: list[list[float]] = field(default_factory=list)
    colors: list[list[float]] = field(default_factory=list)
    texture: list[list[float]] = field(default_factory=list)
    corners: list[int] = field(default_factory=list)
    texture_corners: list[int] = field(default_factory=list)
    counts: list[int] = field(default_factory=list)
    states: list[tuple[str | None, str | None, str | None]] = field(default_factory=list)
    libraries: list[str] = field(default_factory=list)
    skipped: set[str] = field(default_factory=set)


def read_wavefront(path: Path, enclosure: Enclosure) -> ModelScene:
    """Return the scene of an `.obj` file: a placement for each object (`o`; `g` if there is at most one `o`).

    Raises ConfigError, with the line, for an invalid number or index.
    """
    lines = _parse(path)
    warnings = [f"{kind} are left out" for kind in sorted(lines.skipped)]
    materials = _libraries(lines.libraries, enclosure, warnings)
    vertices = np.array(lines.positions, dtype=np.float64).reshape(-1, 3)
    corners = np.array(lines.corners, dtype=np.int64)
    triangles, polygon = triangulate(vertices, corners, np.array(lines.counts, dtype=np.int64))
    names = sorted({state[2] for state in lines.states if state[2] is not None})
    index_of: dict[str | None, int] = {None: -1, **{name: index for index, name in enumerate(names)}}
    material_of = np.array([index_of[state[2]] for state in lines.states], dtype=np.int32)
    warnings += [
        f"material {name!r} is not in its library; its faces are grey" for name in names if name not in materials
    ]
    faces = corners[triangles].astype(np.int32)
    face_material = material_of[polygon]
    paint = None
    if lines.colors and len(lines.colors) == len(vertices):
        paint = face_paint(color_bytes(np.array(lines.colors)), faces)
    uv = np.array(lines.texture, dtype=np.float64).reshape(-1, 2)
    uv_faces = np.array(lines.texture_corners, dtype=np.int64)[triangles]
    whole = Surface(
        name=path.stem,
        vertices=vertices,
        faces=faces,
        face_colors=_face_colors([materials.get(name) for name in names], face_material, uv, uv_faces, paint),
        materials=tuple(names),
        face_material=face_material,
        paint=paint,
    )
    owner, objects = _objects(lines.states, path.stem)
    face_owner = owner[polygon]
    order = np.argsort(face_owner, kind="stable")
    starts = np.searchsorted(face_owner[order], np.arange(len(objects) + 1))
    surfaces = [
        replace(whole.select(order[start:end]), name=name)
        for name, start, end in zip(objects, starts, starts[1:], strict=False)
    ]
    placements = [Placement(name, type_label(name), index, np.eye(4)) for index, name in enumerate(objects)]
    return ModelScene("objects", tuple(surfaces), tuple(placements), tuple(warnings))


def _parse(path: Path) -> _Lines:
    lines = _Lines()
    content = path.read_bytes()
    encoding = "utf-16" if content[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE) else "utf-8-sig"
    text = content.decode(encoding, errors="replace").replace("\\\r\n", " ").replace("\\\n", " ")
    group: str | None = None
    current: str | None = None
    material: str | None = None
    for number, line in enumerate(text.splitlines(), start=1):
        keyword, _, rest = line.strip().partition(" ")
        rest = rest.partition("#")[0].strip() if keyword in ("v", "vt", "f") else rest.strip()
        try:
            if keyword == "v":
                values = [float(word) for word in rest.split()]
                lines.positions.append(values[:3] if len(values) >= 3 else [float("x")])
                if len(values) == 6:
                    lines.colors.append(values[3:])
            elif keyword == "vt":
                lines.texture.append([float(word) for word in [*rest.split(), "0"][:2]])
            elif keyword == "f":
                _parse_face(lines, rest.split())
                lines.states.append((current, group, material))
        except ValueError:
            raise ConfigError(
                f"{path}, line {number}: {line.strip()[:60]!r} is no valid {keyword!r} line; export the file again"
            ) from None
        if keyword == "o":
            current = rest or None
        elif keyword == "g":
            group = rest or None
        elif keyword == "usemtl":
            material = rest or None
        elif keyword == "mtllib":
            lines.libraries.append(rest)
        elif keyword in ("p", "l", "curv", "surf"):
            lines.skipped.add({"p": "points", "l": "lines"}.get(keyword, "free-form curves and surfaces"))
    return lines


def _parse_face(lines: _Lines, words: Sequence[str]) -> None:
    """Append a face. Raises ValueError for an index that is zero, no number, or not yet listed."""
    for word in words:
        vertex, _, rest = word.partition("/")
        lines.corners.append(_index(vertex, len(lines.positions)))
        texture = rest.partition("/")[0]
        lines.texture_corners.append(_index(texture, len(lines.texture)) if texture else -1)
    lines.counts.append(len(words))


def _index(word: str, count: int) -> int:
    number = int(word)
    index = number - 1 if number > 0 else count + number
    if number == 0 or not 0 <= index < count:
        raise ValueError(word)
    return index


def _objects(states: Sequence[tuple[str | None, str | None, str | None]], stem: str) -> tuple[np.ndarray, list[str]]:
    """Return the object of each polygon, and the objects' names in order of appearance."""
    by_object, by_group = ({state[key] for state in states} for key in (0, 1))
    key = 1 if len(by_object) < 2 <= len(by_group) else 0
    names: dict[str, int] = {}
    owner = [names.setdefault(state[key] or state[1 - key] or stem, len(names)) for state in states]
    return np.array(owner, dtype=np.int64), list(names)


def _libraries(libraries: Sequence[str], enclosure: Enclosure, warnings: list[str]) -> dict[str, _Material]:
    materials: dict[str, _Material] = {}
    for line in libraries:
        # the line may hold one name with blanks, or several names
        for names in ([line], line.split()):
            try:
                contents = [enclosure.read(name, "mtllib") for name in names]
            except Outside:
                warnings.append(
                    f"material library {line!r} is outside the folder of the model and is not opened; its "
                    "faces are grey"
                )
                break
            except OSError:
                continue
            for content in contents:
                _parse_library(content.decode("utf-8", errors="replace"), enclosure, materials, warnings)
            break
        else:
            warnings.append(f"material library {line!r} is missing; its faces are grey")
    return materials


def _parse_library(text: str, enclosure: Enclosure, materials: dict[str, _Material], warnings: list[str]) -> None:
    material = _Material()
    for line in text.splitlines():
        keyword, _, rest = line.strip().partition(" ")
        rest = rest.strip()
        if keyword == "newmtl":
            material = materials.setdefault(rest, _Material())
        elif keyword == "Kd":
            try:
                red, green, blue = (float(word) for word in rest.split()[:3])
                material.color = color_bytes(np.array([red, green, blue]))
            except ValueError:
                warnings.append(f"material colour 'Kd {rest}' is not red, green, blue; its faces are grey")
        elif keyword.lower() == "map_kd":
            name = _map_file(rest)
            try:
                material.image = decode_image(enclosure.read(name, "map_Kd"))
            except Outside:
                warnings.append(
                    f"texture {name!r} is outside the folder of the model and is not opened; its faces have the "
                    "material's colour"
                )
            except FileNotFoundError:
                warnings.append(f"texture {name!r} is missing; its faces have the material's colour")
            except OSError as error:
                warnings.append(f"texture {name!r} cannot be read: {error}")


def _map_file(rest: str) -> str:
    """Return the file name of a `map_Kd` line, after its options; it may hold blanks."""
    words = rest.split()
    while words and words[0].startswith("-"):
        option, arguments = words[0], _MAP_OPTIONS.get(words[0], 1)
        words = words[1:]
        while words and arguments and (option not in _MAP_OPTIONS or _is_number(words[0])):
            words, arguments = words[1:], arguments - 1
    return rest[rest.find(words[0]) :] if words else ""


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _face_colors(
    materials: Sequence[_Material | None],
    face_material: np.ndarray,
    uv: np.ndarray,
    uv_faces: np.ndarray,
    paint: ByteArray | None,
) -> ByteArray:
    colors = np.tile(np.array(GREY, np.uint8), (len(face_material), 1))
    if paint is not None:
        colors[:] = paint
    for index, material in enumerate(materials):
        if material is None:
            continue
        has_material = face_material == index
        if paint is None:
            colors[has_material] = material.color
        textured = has_material & (uv_faces >= 0).all(axis=1)
        if material.image is not None and textured.any():
            colors[textured] = sample_texture(material.image, uv, uv_faces[textured])
    return colors
