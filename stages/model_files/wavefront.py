"""Wavefront OBJ with its MTL: objects in file order, n-gons, materials, textures, vertex colours.

trimesh's reader is not used here: it groups faces by material, which breaks up objects and their order. It also reads
one material library only, counts negative indices from the end of the file, and splits n-gons into fans.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from pipeline.errors import ConfigError
from stages.model_files.colors import color_bytes, face_paint, sample_texture, unit_colors
from stages.model_files.enclosure import Enclosure
from stages.model_files.polygons import triangulate
from stages.model_files.scene import GREY, ModelScene, Placement, Surface, type_label
from stages.model_files.source_materials import appearance_of, painted_faces_without_material
from stages.model_files.wavefront_materials import WavefrontMaterial, read_libraries
from stages.model_files.wavefront_text import TextLine, decode_wavefront_text, text_lines
from stages.shape.appearance import NO_MATERIAL, Appearance, Material, given_normals
from stages.shape.arrays import ByteArray, IntArray

_WITHOUT_SHAPE = {
    "s", "mg", "bevel", "c_interp", "d_interp", "lod", "shadow_obj", "trace_obj", "ctech", "stech",
}  # fmt: skip
"""Keywords that change how a model is rendered, and not which faces and colours it has."""
_FREE_FORM = "free-form curves and surfaces"
_LEFT_OUT = {
    "p": "points",
    "l": "lines",
    **dict.fromkeys(("vp", "cstype", "deg", "bmat", "step", "curv", "curv2", "surf", "parm", "trim"), _FREE_FORM),
    **dict.fromkeys(("hole", "scrv", "sp", "end", "con"), _FREE_FORM),
    **dict.fromkeys(("bsp", "bzp", "cdc", "cdp", "res"), _FREE_FORM),
    **dict.fromkeys(("maplib", "usemap"), "texture maps outside materials"),
    **dict.fromkeys(("call", "csh"), "commands"),
}
_MRGB_LETTERS = 8
"""Letters of each colour in ZBrush's comments: mask, red, green, blue."""


@dataclass
class _Lines:
    """The content of the lines of an OBJ, before triangulation.

    colors: vertex and numbers of each coloured vertex.
    states: object number, object name, group and material of each face; the number counts `o` lines.
    forward: face corners whose vertices were not yet listed, with the line.
    """

    positions: list[list[float]] = field(default_factory=list)
    colors: list[tuple[int, list[float]]] = field(default_factory=list)
    brushed: list[str] = field(default_factory=list)
    texture: list[list[float]] = field(default_factory=list)
    normals: list[list[float]] = field(default_factory=list)
    corners: list[int] = field(default_factory=list)
    texture_corners: list[int] = field(default_factory=list)
    normal_corners: list[int] = field(default_factory=list)
    counts: list[int] = field(default_factory=list)
    states: list[tuple[int, str | None, str | None, str | None]] = field(default_factory=list)
    libraries: list[TextLine] = field(default_factory=list)
    left_out: Counter[str] = field(default_factory=Counter)
    unknown: dict[str, list[int]] = field(default_factory=dict)
    forward: list[tuple[int, TextLine]] = field(default_factory=list)


def read_wavefront(path: Path, enclosure: Enclosure) -> ModelScene:
    """Return the scene of an `.obj` file: a placement for each `o` line (for each `g` if there is at most one `o`).

    Raises ConfigError, with the line, for an invalid number or index.
    """
    lines = _parse(path)
    warnings = [f"{count:,} {kind} are left out" for kind, count in sorted(lines.left_out.items())]
    warnings += [
        f"{len(numbers):,} lines that begin with {keyword[:40]!r}, the first of them line {numbers[0]}, are not read"
        for keyword, numbers in lines.unknown.items()
    ]
    not_kept: list[str] = []
    materials = read_libraries(lines.libraries, enclosure, warnings, not_kept)
    vertices = np.array(lines.positions, dtype=np.float64).reshape(-1, 3)
    corners = np.array(lines.corners, dtype=np.int64)
    triangles, polygon = triangulate(vertices, corners, np.array(lines.counts, dtype=np.int64))
    names = sorted({state[3] for state in lines.states if state[3] is not None})
    index_of: dict[str | None, int] = {None: -1, **{name: index for index, name in enumerate(names)}}
    material_of = np.array([index_of[state[3]] for state in lines.states], dtype=np.int32)
    warnings += [
        f"material {name!r} is not in its library; its faces are grey" for name in names if name not in materials
    ]
    faces = corners[triangles].astype(np.int32)
    face_material = material_of[polygon]
    uv = np.array(lines.texture, dtype=np.float64).reshape(-1, 2)
    uv_faces = np.array(lines.texture_corners, dtype=np.int64)[triangles]
    paint, is_painted = _paint(lines, faces, warnings)
    face_colors = _face_colors([materials.get(name) for name in names], face_material, uv, uv_faces, paint, is_painted)
    whole = Surface(
        name=path.stem,
        vertices=vertices,
        faces=faces,
        face_colors=face_colors,
        materials=tuple(names),
        face_material=face_material,
        paint=paint,
    )
    if len(faces):
        look = _appearance(whole, materials, lines, triangles, np.where(is_painted, 0, 255), not_kept)
        whole = replace(whole, appearance=look)
    owner, objects = _objects(lines.states, path.stem)
    face_owner = owner[polygon]
    order = np.argsort(face_owner, kind="stable")
    starts = np.searchsorted(face_owner[order], np.arange(len(objects) + 1))
    surfaces = [
        replace(whole.select(order[start:end]), name=name)
        for name, start, end in zip(objects, starts, starts[1:], strict=False)
    ]
    placements = [Placement(name, type_label(name), index, np.eye(4)) for index, name in enumerate(objects)]
    return ModelScene(
        "objects", tuple(surfaces), tuple(placements), tuple(warnings), not_kept=tuple(dict.fromkeys(not_kept))
    )


def _appearance(
    surface: Surface,
    stated: Mapping[str, WavefrontMaterial],
    lines: _Lines,
    triangles: IntArray,
    whiteness: np.ndarray,
    not_kept: list[str],
) -> Appearance | None:
    """Return the look of all faces.

    triangles: corners of the faces, as indices into the corners of the file, int32 (f, 3)
    whiteness: 0 for faces whose vertices have colours, else 255, int (f,)
    """
    known = [stated.get(name) for name in surface.materials]
    materials = [
        Material(name) if own is None else own.described(name)
        for name, own in zip(surface.materials, known, strict=True)
    ]
    is_known = np.array([*(own is not None for own in known), False])  # the last for no material
    face_material = np.asarray(surface.face_material)
    face_material = np.where(is_known[face_material], face_material, NO_MATERIAL).astype(np.int32)
    paint = np.repeat(whiteness.astype(np.uint8)[:, None], 3, axis=1)
    face_material, painted = painted_faces_without_material(face_material, materials, paint)
    not_kept += [f"material {name!r}: faces with vertex colours have these alone" for name in painted]
    uv = normals = None
    if lines.texture:
        table = np.array([*lines.texture, [0.0, 0.0]])
        at = np.array(lines.texture_corners, dtype=np.int64)[triangles]
        uv = table[np.where((at >= 0) & (at < len(lines.texture)), at, -1)]
        for number, own in enumerate(known):
            if own is not None and own.image is not None:
                uv[face_material == number] = uv[face_material == number] * own.scale + own.offset
        uv[:, :, 1] = 1.0 - uv[:, :, 1]
    if lines.normals:
        directions = np.array([*lines.normals, [0.0, 0.0, 0.0]])
        at = np.array(lines.normal_corners, dtype=np.int64)[triangles]
        stated_normals = directions[np.where((at >= 0) & (at < len(lines.normals)), at, -1)]
        normals = given_normals(surface.vertices[surface.faces], stated_normals)
    return appearance_of(materials, face_material, uv, normals)


def _parse(path: Path) -> _Lines:
    lines = _Lines()
    text = decode_wavefront_text(path.read_bytes())
    if "#MRGB" in text:
        lines.brushed = [
            line.split()[1] for line in text.splitlines() if line.startswith("#MRGB ") and line.split()[1:]
        ]
    number = 0
    current: str | None = None
    group: str | None = None
    material: str | None = None
    for line in text_lines(text):
        keyword, rest = line.keyword, line.rest
        try:
            if keyword == "v":
                _parse_vertex(lines, _numbers(rest))
            elif keyword == "vt":
                lines.texture.append([*_numbers(rest), 0.0, 0.0][:2])
            elif keyword == "vn":
                lines.normals.append(_direction(rest))
            elif keyword in ("f", "fo"):
                _parse_face(lines, rest.partition("#")[0].split(), line)
                lines.states.append((number, current, group, material))
            elif keyword == "o":
                number, current = number + 1, rest or None
            elif keyword == "g":
                group = rest or None
            elif keyword == "usemtl":
                material = rest or None
            elif keyword == "mtllib":
                lines.libraries.append(line)
            elif keyword in _LEFT_OUT:
                lines.left_out[_LEFT_OUT[keyword]] += 1
            elif keyword not in _WITHOUT_SHAPE:
                lines.unknown.setdefault(keyword, []).append(line.number)
        except ValueError:
            raise _invalid(path, line) from None
    for index, line in lines.forward:
        if index >= len(lines.positions):
            raise _invalid(path, line)
    return lines


def _invalid(path: Path, line: TextLine) -> ConfigError:
    shown = f"{line.keyword} {line.rest}"[:60]
    return ConfigError(
        f"{path}, line {line.number}: {shown!r} is no valid {line.keyword!r} line; export the file again"
    )


def _numbers(rest: str) -> list[float]:
    return [float(word) for word in rest.partition("#")[0].split()]


def _direction(rest: str) -> list[float]:
    """Return the normal of a `vn` line; zero for what is no direction."""
    try:
        x, y, z, *_ = _numbers(rest)
    except ValueError:
        return [0.0, 0.0, 0.0]
    return [x, y, z]


def _parse_vertex(lines: _Lines, numbers: Sequence[float]) -> None:
    """Append a vertex: x, y, z, then a weight, a colour, or both. Raises ValueError for fewer than three numbers."""
    x, y, z, *more = numbers
    if len(more) in (3, 4):
        lines.colors.append((len(lines.positions), more))
    elif len(more) > 1:
        lines.left_out["colours of vertices that are not three or four numbers"] += 1
    lines.positions.append([x, y, z])


def _parse_face(lines: _Lines, words: Sequence[str], line: TextLine) -> None:
    """Append a face. Raises ValueError for an index that is zero, no number, or before the first."""
    for word in words:
        vertex, _, rest = word.partition("/")
        texture, _, normal = rest.partition("/")
        index = _index(vertex, len(lines.positions))
        if index >= len(lines.positions):
            lines.forward.append((index, line))
        lines.corners.append(index)
        lines.texture_corners.append(_index(texture, len(lines.texture)) if texture else -1)
        lines.normal_corners.append(_normal_index(normal, len(lines.normals)) if normal else -1)
    lines.counts.append(len(words))
    if len(words) < 3:
        lines.left_out["faces with fewer than three corners"] += 1


def _index(word: str, count: int) -> int:
    number = int(word)
    index = number - 1 if number > 0 else count + number
    if number == 0 or index < 0:
        raise ValueError(word)
    return index


def _normal_index(word: str, count: int) -> int:
    """Return the index of a normal, -1 for an invalid one: the normal of the face replaces it."""
    try:
        return _index(word, count)
    except ValueError:
        return -1


def _objects(states: Sequence[tuple[int, str | None, str | None, str | None]], stem: str) -> tuple[IntArray, list[str]]:
    """Return the object of each polygon, and the objects' names in order of appearance.

    Every `o` line begins an object, whatever its name. Groups of one name are one object.
    """
    objects, groups = {state[0] for state in states}, {state[2] for state in states}
    by_group = len(objects) < 2 <= len(groups)
    numbers: dict[int | str | None, int] = {}
    names: list[str] = []
    owner = []
    for number, current, group, _ in states:
        key = group if by_group else number
        if key not in numbers:
            numbers[key] = len(names)
            names.append((group or current if by_group else current or group) or stem)
        owner.append(numbers[key])
    return np.array(owner, dtype=np.int32), names


def _paint(lines: _Lines, faces: IntArray, warnings: list[str]) -> tuple[ByteArray | None, np.ndarray]:
    """Return the vertex colours as face paint, if any face has them, and the faces that have, bool (f,)."""
    colors = np.tile(np.array(GREY, np.uint8), (len(lines.positions), 1))
    is_colored = np.zeros(len(lines.positions), dtype=bool)
    if lines.colors:
        rows = [row for row, _ in lines.colors]
        colors[rows] = color_bytes(unit_colors(_color_columns([numbers for _, numbers in lines.colors])))
        is_colored[rows] = True
    elif lines.brushed:
        brushed = _brushed_colors("".join(lines.brushed))[: len(colors)]
        colors[: len(brushed)] = brushed
        is_colored[: len(brushed)] = True
    is_painted = np.asarray(is_colored[faces].all(axis=1))
    if not is_painted.any():
        return None, is_painted
    if not is_painted.all():
        warnings.append(
            f"only {np.count_nonzero(is_colored):,} of {len(colors):,} vertices have a colour; "
            f"{np.count_nonzero(~is_painted):,} triangles have that of their material instead"
        )
    paint = face_paint(colors, faces)
    paint[~is_painted] = GREY
    return paint, is_painted


def _color_columns(numbers: Sequence[Sequence[float]]) -> np.ndarray:
    """Return red, green and blue of what follows x, y, z: with alpha after them, or with a weight in front."""
    four = np.array([row for row in numbers if len(row) == 4]).reshape(-1, 4)
    has_alpha = len(four) and (np.ptp(four[:, 3]) == 0 and four[0, 3] in (1.0, 255.0))
    has_weight = len(four) and not has_alpha and bool((four[:, 0] == 1.0).all())
    return np.array([row[1:] if has_weight and len(row) == 4 else row[:3] for row in numbers])


def _brushed_colors(letters: str) -> ByteArray:
    """Return the colours of ZBrush's comments `#MRGB`, which list them for all vertices, uint8 (n, 3)."""
    try:
        content = bytes.fromhex(letters[: len(letters) // _MRGB_LETTERS * _MRGB_LETTERS])
    except ValueError:
        return np.empty((0, 3), np.uint8)
    return np.frombuffer(content, np.uint8).reshape(-1, 4)[:, 1:]


def _face_colors(
    materials: Sequence[WavefrontMaterial | None],
    face_material: IntArray,
    uv: np.ndarray,
    uv_faces: np.ndarray,
    paint: ByteArray | None,
    is_painted: np.ndarray,
) -> ByteArray:
    colors = np.tile(np.array(GREY, np.uint8), (len(face_material), 1)) if paint is None else paint.copy()
    for index, material in enumerate(materials):
        if material is None:
            continue
        has_material = face_material == index
        colors[has_material & ~is_painted] = material.color
        textured = has_material & ((uv_faces >= 0) & (uv_faces < len(uv))).all(axis=1)
        if material.image is not None and textured.any():
            placed = uv * material.scale + material.offset
            pixels, wrap = material.image.pixels, material.wrap
            colors[textured] = sample_texture(pixels, placed, uv_faces[textured], wrap, wrap)
    return colors
