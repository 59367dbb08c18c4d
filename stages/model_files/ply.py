"""PLY, ASCII and binary: polygons of any size, face and vertex colours, one texture.

trimesh's reader is not used here: it refuses binary files that mix polygons of several sizes, and puts face colours
on the wrong triangles where it splits polygons.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.errors import ConfigError
from stages.model_files.colors import color_bytes, decode_image, face_paint, sample_texture, unit_colors
from stages.model_files.enclosure import Enclosure, Outside
from stages.model_files.polygons import triangulate
from stages.model_files.scene import GREY, INVALID, Malformed, ModelScene, Placement, Surface
from stages.shape.arrays import ByteArray, FloatArray

_TYPES = {
    "char": "i1",
    "uchar": "u1",
    "short": "i2",
    "ushort": "u2",
    "int": "i4",
    "uint": "u4",
    "float": "f4",
    "double": "f8",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "int64": "i8",
    "uint64": "u8",
    "float32": "f4",
    "float64": "f8",
}
_CORNER_LISTS = ("vertex_indices", "vertex_index", "vertex_indexes", "indices", "index")
_STRIPS = ("tristrips", "tristrip", "triangle_strips")
_COLOR_NAMES = tuple(
    tuple(f"{prefix}{channel}{suffix}" for channel in channels)
    for channels in (("red", "green", "blue"), ("r", "g", "b"))
    for prefix, suffix in (
        ("", ""),
        ("diffuse_", ""),
        ("vertex_", ""),
        ("color_", ""),
        ("", "_color"),
        ("ambient_", ""),
    )
)
_COLOR_LISTS = ("rgb", "rgba", "color", "colour", "colors", "colours")
_HEADER = re.compile(rb"ply[ \t]*(\r\n|\n|\r)(.*?)\1[ \t]*end_header[ \t]*\1", re.DOTALL)
_ENCODINGS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass(frozen=True)
class _Property:
    name: str
    dtype: str
    length: str | None  # type of the length in front of a list; None for a single value


@dataclass
class _Element:
    name: str
    count: int
    properties: list[_Property]


@dataclass(frozen=True)
class _Column:
    """The values of one property, item after item.

    lengths: the number of values of each item, for lists.
    """

    values: np.ndarray
    lengths: np.ndarray | None = None


def read_ply(path: Path, enclosure: Enclosure) -> ModelScene:
    """Return the surface of a `.ply` file. Raises ConfigError for a file that is cut off or malformed."""
    content = path.read_bytes()
    try:
        elements, order, texture, start = _header(content, enclosure)
        read = _ascii if order == "" else _binary
        columns = read(content[start:], elements, order, enclosure)
        warnings = _left_out(elements)
        vertex, face = columns.get("vertex", {}), columns.get("face", {})
        vertices = _rows("vertex", vertex, ("x", "y", "z")).astype(np.float64)
        indices, lengths = _polygons(face, columns, warnings)
        if len(indices) and (indices.min() < 0 or indices.max() >= len(vertices)):
            raise Malformed(f"a face on vertex {indices.max()} of {len(vertices)}")
        of_faces, of_vertices = _colors("face", face, warnings), _colors("vertex", vertex, warnings)
        if of_faces is not None and len(of_faces) < len(lengths):  # strips have no colours
            grey = np.tile(np.array(GREY, np.uint8), (len(lengths) - len(of_faces), 1))
            of_faces = np.concatenate([of_faces, grey])
    except (ArithmeticError, LookupError, TypeError, ValueError) as error:
        reason = error if isinstance(error, Malformed) else f"{enclosure.at} {INVALID}"
        raise ConfigError(f"{path}: not a whole PLY file ({reason}); copy or export it again") from None
    triangles, polygon = triangulate(vertices, indices, lengths)
    faces = indices[triangles].astype(np.int32)
    paint: ByteArray | None = None
    face_colors: ByteArray = np.tile(np.array(GREY, np.uint8), (len(faces), 1))
    if of_faces is not None:
        face_colors = paint = of_faces[polygon]
    elif of_vertices is not None:
        paint = face_paint(of_vertices, faces)
        face_colors = np.rint(of_vertices[faces].mean(axis=1)).astype(np.uint8)
    elif texture is not None:
        face_colors = _textured(texture, enclosure, vertex, face, lengths, triangles, faces, face_colors, warnings)
    surface = Surface(path.stem, vertices, faces, face_colors, paint=paint)
    return ModelScene("objects", (surface,), (Placement(path.stem, None, 0, np.eye(4)),), tuple(warnings))


def read_ply_points(path: Path, enclosure: Enclosure) -> tuple[FloatArray, FloatArray | None, ByteArray | None] | None:
    """Return points (n, 3), normals (n, 3) and colours uint8 (n, 3) sRGB of a point cloud; None for a file with faces.

    Raises ConfigError for a file that is cut off or malformed.
    """
    content = path.read_bytes()
    try:
        elements, order, _, start = _header(content, enclosure)
        if any(element.name == "face" and element.count for element in elements):
            return None
        vertex = (_ascii if order == "" else _binary)(content[start:], elements, order, enclosure).get("vertex", {})
        points = _rows("vertex", vertex, ("x", "y", "z")).astype(np.float64)
        axes = ("nx", "ny", "nz")
        normals = _rows("vertex", vertex, axes).astype(np.float64) if vertex.keys() >= set(axes) else None
        return points, normals, _colors("vertex", vertex, [])
    except (ArithmeticError, LookupError, TypeError, ValueError) as error:
        reason = error if isinstance(error, Malformed) else f"{enclosure.at} {INVALID}"
        raise ConfigError(f"{path}: not a whole PLY file ({reason}); copy or export it again") from None


def _header(content: bytes, enclosure: Enclosure) -> tuple[list[_Element], str, str | None, int]:
    """Return elements, byte order (empty for ASCII), texture file, and the offset after the header."""
    found = _HEADER.match(content)
    if found is None:
        raise Malformed("no PLY header")
    elements: list[_Element] = []
    order, texture = None, None
    for line in re.split(r"\r\n|\n|\r", found[2].decode("utf-8", errors="replace")):
        words = line.split()
        enclosure.at = f"the header's line {line[:60]!r}"
        if words[:1] == ["format"]:
            order = _ENCODINGS[words[1]]
        elif words[:2] == ["comment", "TextureFile"]:
            texture = line.split(maxsplit=2)[2].strip()
        elif words[:1] == ["element"]:
            elements.append(_Element(words[1], int(words[2]), []))
        elif words[:2] == ["property", "list"]:
            elements[-1].properties.append(_Property(words[4].lower(), _TYPES[words[3]], _TYPES[words[2]]))
        elif words[:1] == ["property"]:
            elements[-1].properties.append(_Property(words[2].lower(), _TYPES[words[1]], None))
    # a row without properties takes no bytes, so nothing would limit its count
    elements = [element for element in elements if element.properties]
    if any(element.count < 0 for element in elements):
        raise Malformed("an element has a negative number of rows")
    if order is None:
        raise Malformed("no format line")
    return elements, order, texture, found.end()


def _binary(body: bytes, elements: list[_Element], order: str, enclosure: Enclosure) -> dict[str, dict[str, _Column]]:
    columns: dict[str, dict[str, _Column]] = {}
    offset = 0
    for element in elements:
        enclosure.at = f"element {element.name}"
        fixed = _fixed_rows(body, offset, element, order)
        if fixed is not None:
            columns[element.name], offset = fixed
            continue
        gathered: list[list[np.ndarray]] = [[] for _ in element.properties]
        for _ in range(element.count):
            for column, values in zip(element.properties, gathered, strict=True):
                size = 1
                if column.length is not None:
                    size = int(np.frombuffer(body, order + column.length, 1, offset)[0])
                    offset += np.dtype(column.length).itemsize
                if size < 0:
                    raise Malformed(f"element {element.name} has a list of {size} values")
                values.append(np.frombuffer(body, order + column.dtype, size, offset))
                offset += size * np.dtype(column.dtype).itemsize
        columns[element.name] = {
            column.name: _Column(
                np.concatenate(values) if values else np.empty(0, column.dtype),
                None if column.length is None else np.array([len(value) for value in values], dtype=np.int64),
            )
            for column, values in zip(element.properties, gathered, strict=True)
        }
    return columns


def _fixed_rows(body: bytes, offset: int, element: _Element, order: str) -> tuple[dict[str, _Column], int] | None:
    """Return the columns of an element, read together; None if its lists have several lengths."""
    fields: list[tuple[str, str] | tuple[str, str, tuple[int]]] = []
    at, lengths = offset, {}
    for column in element.properties:
        if column.length is not None:
            size = int(np.frombuffer(body, order + column.length, 1, at)[0]) if element.count else 0
            lengths[column.name] = size
            fields.append((f"{column.name} length", order + column.length))
            fields.append((column.name, order + column.dtype, (size,)))
            at += np.dtype(column.length).itemsize + size * np.dtype(column.dtype).itemsize
        else:
            fields.append((column.name, order + column.dtype))
            at += np.dtype(column.dtype).itemsize
    dtype = np.dtype(fields)
    if offset + element.count * dtype.itemsize > len(body):
        if lengths:
            return None
        raise ValueError(f"element {element.name} is cut off")
    rows = np.frombuffer(body, dtype, element.count, offset)
    if any((rows[f"{name} length"] != size).any() for name, size in lengths.items()):
        return None
    columns = {
        column.name: _Column(
            rows[column.name].ravel(),
            None if column.length is None else np.full(element.count, lengths[column.name], dtype=np.int64),
        )
        for column in element.properties
    }
    return columns, offset + element.count * dtype.itemsize


def _ascii(body: bytes, elements: list[_Element], order: str, enclosure: Enclosure) -> dict[str, dict[str, _Column]]:
    words = body.split()
    columns: dict[str, dict[str, _Column]] = {}
    at = 0
    for element in elements:
        enclosure.at = f"element {element.name}"
        gathered: list[list[bytes]] = [[] for _ in element.properties]
        lengths: list[list[int]] = [[] for _ in element.properties]
        for _ in range(element.count):
            for number, column in enumerate(element.properties):
                size = 1
                if column.length is not None:
                    size = int(words[at])
                    at += 1
                if not 0 <= size <= len(words) - at:
                    raise Malformed(f"element {element.name} is cut off")
                gathered[number].extend(words[at : at + size])
                lengths[number].append(size)
                at += size
        columns[element.name] = {
            column.name: _Column(
                np.array(gathered[number], dtype=np.float64).astype(column.dtype if column.dtype[0] != "f" else "f8"),
                None if column.length is None else np.array(lengths[number], dtype=np.int64),
            )
            for number, column in enumerate(element.properties)
        }
    return columns


def _rows(element: str, columns: dict[str, _Column], names: tuple[str, ...]) -> np.ndarray:
    """Return the single values called `names` of each item of an element (n, len(names))."""
    for name in names:
        if name not in columns:
            raise Malformed(f"element {element} has no property {name}")
        if columns[name].lengths is not None:
            raise Malformed(f"property {name} of element {element} is a list")
    return np.stack([columns[name].values for name in names], axis=1)


def _left_out(elements: list[_Element]) -> list[str]:
    """Return a sentence for each element that is not read."""
    read = ("vertex", "face", *_STRIPS)
    return [
        f"element {element.name[:40]!r} with {element.count:,} rows is left out"
        for element in elements
        if element.count and element.name not in read
    ]


def _polygons(
    face: dict[str, _Column], columns: dict[str, dict[str, _Column]], warnings: list[str]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners of the faces, then of the triangles of strips; and the number of corners of each."""
    corners = next((face[name] for name in _CORNER_LISTS if name in face), None)
    indices = lengths = np.empty(0, np.int64)
    if corners is not None and corners.lengths is not None:
        indices, lengths = corners.values.astype(np.int64), corners.lengths
    elif count := max((len(column.values) for column in face.values()), default=0):
        warnings.append(
            f"element 'face' has no list {' or '.join(_CORNER_LISTS[:2])}; its {count:,} values are left out"
        )
    if few := np.count_nonzero(lengths < 3):
        warnings.append(f"{few:,} faces with fewer than three corners are left out")
    for name in _STRIPS:
        for column in columns.get(name, {}).values():
            if column.lengths is not None and column.values.dtype.kind in "iu":
                strips = np.split(column.values.astype(np.int64), np.cumsum(column.lengths)[:-1])
                triangles = np.concatenate(
                    [_strip_triangles(strip) for strip in strips] or [np.empty((0, 3), np.int64)]
                )
                indices = np.concatenate([indices, triangles.ravel()])
                lengths = np.concatenate([lengths, np.full(len(triangles), 3)])
    return indices, lengths


def _strip_triangles(strip: np.ndarray) -> np.ndarray:
    """Return the triangles of a strip, int64 (t, 3); a negative index begins another strip."""
    triangles = np.stack([strip[:-2], strip[1:-1], strip[2:]], axis=1) if len(strip) > 2 else np.empty((0, 3), np.int64)
    numbers = np.arange(len(strip))
    restarts = np.maximum.accumulate(np.where(strip < 0, numbers + 1, 0))
    is_odd = (numbers[: len(triangles)] - restarts[: len(triangles)]) % 2 == 1
    triangles[is_odd] = triangles[is_odd][:, [1, 0, 2]]
    kept: np.ndarray = triangles[(triangles >= 0).all(axis=1)]
    return kept


def _colors(element: str, columns: dict[str, _Column], warnings: list[str]) -> ByteArray | None:
    """Return the colours of an element, by any usual name; None, with a warning, for what seems to be colours."""
    for names in _COLOR_NAMES:
        if columns.keys() >= set(names):
            return color_bytes(unit_colors(_rows(element, columns, names)))
    for name in _COLOR_LISTS:
        column = columns.get(name)
        if column is not None and column.lengths is None and column.values.dtype.itemsize in (4, 8):
            return _unpacked_colors(column.values)
        if column is not None and column.lengths is not None and len(column.lengths):
            width = int(column.lengths[0])
            if width in (3, 4) and (column.lengths == width).all():
                return color_bytes(unit_colors(column.values.reshape(-1, width)))
    named = [
        name for name in columns if any(word in name for word in ("red", "green", "blue", "color", "colour", "rgb"))
    ]
    if named:
        listed = ", ".join(named)[:80]
        warnings.append(
            f"properties {listed} of element {element} are no red, green and blue that are known; they are left out"
        )
    return None


def _unpacked_colors(values: np.ndarray) -> ByteArray:
    """Return the colours in the lower three bytes of 32 bits, which may be stored as a float (Point Cloud Library)."""
    words = values.astype(np.float32).view(np.uint32) if values.dtype.kind == "f" else values.astype(np.uint32)
    return np.stack([words >> 16 & 255, words >> 8 & 255, words & 255], axis=1).astype(np.uint8)


def _textured(
    texture: str,
    enclosure: Enclosure,
    vertex: dict[str, _Column],
    face: dict[str, _Column],
    lengths: np.ndarray,
    triangles: np.ndarray,
    faces: np.ndarray,
    plain: ByteArray,
    warnings: list[str],
) -> ByteArray:
    """Return face colours from the texture, by coordinates of face corners or of vertices; `plain` without them."""
    uv: FloatArray | None = None
    corners = faces
    for names in (("texture_u", "texture_v"), ("s", "t"), ("u", "v")):
        if all(name in vertex and vertex[name].lengths is None for name in names):
            uv = _rows("vertex", vertex, names).astype(np.float64)
    if "texcoord" in face:
        texcoord = face["texcoord"]
        if texcoord.lengths is not None and np.array_equal(texcoord.lengths, 2 * lengths):
            uv, corners = texcoord.values.reshape(-1, 2).astype(np.float64), triangles
        else:
            warnings.append("property texcoord of element face has no two numbers for each corner; it is left out")
    try:
        image = decode_image(enclosure.read(texture, "TextureFile"))
    except Outside:
        warnings.append(f"texture {texture!r} is outside the folder of the model and is not opened; its faces are grey")
        return plain
    except FileNotFoundError:
        warnings.append(f"texture {texture!r} is missing; its faces are grey")
        return plain
    except OSError as error:
        warnings.append(f"texture {texture!r} cannot be read: {error}")
        return plain
    return plain if uv is None else sample_texture(image, uv, corners)
