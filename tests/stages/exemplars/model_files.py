"""Model files written by hand: what readers are tried on."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

__all__ = ["BOX_FACES", "Glb", "box", "png", "signed_volume", "world_triangles", "write_obj"]

BOX_FACES = np.array(
    [0, 2, 1, 0, 3, 2, 4, 5, 6, 4, 6, 7, 0, 1, 5, 0, 5, 4, 1, 2, 6, 1, 6, 5, 2, 3, 7, 2, 7, 6, 3, 0, 4, 3, 4, 7],
    dtype=np.int32,
).reshape(-1, 3)


def box(size: tuple[float, float, float] = (1, 1, 1), at: tuple[float, float, float] = (0, 0, 0)) -> np.ndarray:
    """The corners of a box, float64 (8, 3), for BOX_FACES; it faces outward."""
    unit = np.array([[x, y, z] for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))], dtype=np.float64)
    return unit * size + at


def signed_volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def world_triangles(vertices: np.ndarray, faces: np.ndarray, pose: np.ndarray | None = None) -> np.ndarray:
    """Triangles in the world, (f, 9), each from its lowest corner on, sorted: equal for equal oriented surfaces."""
    pose = np.eye(4) if pose is None else pose
    corners = (vertices @ pose[:3, :3].T + pose[:3, 3])[faces]
    rows = []
    for triangle in np.round(corners, 4) + 0.0:
        begin = min(range(3), key=lambda k: tuple(triangle[k]))
        rows.append(np.roll(triangle, -begin, axis=0).ravel())
    return np.array(sorted(map(tuple, rows)))


def png(pixels: np.ndarray) -> bytes:
    import io

    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(pixels.astype(np.uint8)).save(stream, format="PNG")
    return stream.getvalue()


class Glb:
    """Builds a glTF header and its binary chunk."""

    def __init__(self) -> None:
        self.header: dict[str, Any] = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}]}
        for key in ("nodes", "meshes", "accessors", "bufferViews", "materials"):
            self.header[key] = []
        self.chunk = b""

    def view(self, content: bytes) -> int:
        self.chunk += b"\0" * (-len(self.chunk) % 4)
        self.header["bufferViews"].append({"buffer": 0, "byteOffset": len(self.chunk), "byteLength": len(content)})
        self.chunk += content
        return len(self.header["bufferViews"]) - 1

    def accessor(self, values: np.ndarray, **extra: Any) -> int:
        values = np.asarray(values)
        code = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}[values.dtype.str[1:]]
        width = 1 if values.ndim == 1 else values.shape[1]
        kind = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}[width]
        accessor = {
            "bufferView": self.view(values.tobytes()),
            "componentType": code,
            "count": len(values),
            "type": kind,
        }
        self.header["accessors"].append({**accessor, **extra})
        return len(self.header["accessors"]) - 1

    def primitive(self, vertices: np.ndarray, faces: np.ndarray, **extra: Any) -> dict[str, Any]:
        position = self.accessor(np.asarray(vertices, dtype="<f4"))
        indices = self.accessor(np.asarray(faces, dtype="<u4").ravel())
        return {"attributes": {"POSITION": position}, "indices": indices, **extra}

    def mesh(self, *primitives: dict[str, Any], name: str | None = None) -> int:
        named = {} if name is None else {"name": name}
        self.header["meshes"].append({"primitives": list(primitives), **named})
        return len(self.header["meshes"]) - 1

    def node(self, root: bool = True, **node: Any) -> int:
        self.header["nodes"].append(node)
        if root:
            self.header["scenes"][0]["nodes"].append(len(self.header["nodes"]) - 1)
        return len(self.header["nodes"]) - 1

    def material(self, color: tuple[float, float, float], name: str = "") -> int:
        self.header["materials"].append({"name": name, "pbrMetallicRoughness": {"baseColorFactor": [*color, 1]}})
        return len(self.header["materials"]) - 1

    def content(self) -> bytes:
        header = dict(self.header)
        header.setdefault("buffers", [{"byteLength": len(self.chunk)}])
        text = json.dumps(header).encode()
        text += b" " * (-len(text) % 4)
        chunk = self.chunk + b"\0" * (-len(self.chunk) % 4)
        body = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(chunk), 0x004E4942) + chunk
        return b"glTF" + struct.pack("<II", 2, 12 + len(body)) + body

    def write(self, path: Path) -> Path:
        path.write_bytes(self.content())
        return path


def write_obj(path: Path, boxes: dict[str, np.ndarray], head: str = "", before: dict[str, str] | None = None) -> Path:
    """An OBJ with one object a box; `before` holds lines that stand in front of an object's faces."""
    lines = [head]
    for number, (name, corners) in enumerate(boxes.items()):
        lines.append(f"o {name}")
        lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in corners.tolist()]
        lines.append((before or {}).get(name, ""))
        lines += [f"f {a} {b} {c}" for a, b, c in (BOX_FACES + 1 + 8 * number).tolist()]
    path.write_text("\n".join(lines) + "\n")
    return path
