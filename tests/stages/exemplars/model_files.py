"""Model files written by hand for tests of readers."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

BOX_FACES = np.array(
    [0, 2, 1, 0, 3, 2, 4, 5, 6, 4, 6, 7, 0, 1, 5, 0, 5, 4, 1, 2, 6, 1, 6, 5, 2, 3, 7, 2, 7, 6, 3, 0, 4, 3, 4, 7],
    dtype=np.int32,
).reshape(-1, 3)


def box(size: tuple[float, float, float] = (1, 1, 1), at: tuple[float, float, float] = (0, 0, 0)) -> np.ndarray:
    """Return the corners of a box, float64 (8, 3), for the outward faces BOX_FACES."""
    unit = np.array([[x, y, z] for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))], dtype=np.float64)
    return unit * size + at


def signed_volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def world_triangles(vertices: np.ndarray, faces: np.ndarray, pose: np.ndarray | None = None) -> np.ndarray:
    """Return triangles in the world, (f, 9), from their lowest corners, sorted: equal for equal oriented surfaces."""
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
    """Build a glTF header and its binary chunk."""

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
    """Write an OBJ with one object a box; `before` holds lines in front of an object's faces."""
    lines = [head]
    for number, (name, corners) in enumerate(boxes.items()):
        lines.append(f"o {name}")
        lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in corners.tolist()]
        lines.append((before or {}).get(name, ""))
        lines += [f"f {a} {b} {c}" for a, b, c in (BOX_FACES + 1 + 8 * number).tolist()]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def textured_glb(image: str) -> Glb:
    """Write two adjacent boxes with a texture, the file `image`."""
    glb = Glb()
    glb.header["images"] = [{"uri": image}]
    glb.header["textures"] = [{"source": 0}]
    glb.header["materials"] = [{"name": "skin", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    primitive = glb.primitive(box(), BOX_FACES, material=0)
    primitive["attributes"]["TEXCOORD_0"] = glb.accessor(box()[:, :2].astype("<f4"))
    mesh = glb.mesh(primitive, name="box")
    glb.node(name="box.001", mesh=mesh)
    glb.node(name="box.002", mesh=mesh, translation=[2, 0, 0])
    return glb


def textured_dae(image: str) -> str:
    """Write a square that two nodes place, one above the other, with a texture, the file `image`."""
    return f"""<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><created>2020-01-01T00:00:00Z</created><modified>2020-01-01T00:00:00Z</modified>
<unit name="half" meter="0.5"/><up_axis>Z_UP</up_axis></asset>
<library_images><image id="i"><init_from>{image}</init_from></image></library_images>
<library_effects><effect id="e"><profile_COMMON><newparam sid="s"><surface type="2D"><init_from>i</init_from></surface>
</newparam><newparam sid="t"><sampler2D><source>s</source></sampler2D></newparam><technique sid="c"><lambert><diffuse>
<texture texture="t" texcoord="UV"/></diffuse></lambert></technique></profile_COMMON></effect></library_effects>
<library_materials><material id="m" name="skin"><instance_effect url="#e"/></material></library_materials>
<library_geometries><geometry id="g" name="tile"><mesh>
<source id="p"><float_array id="pa" count="12">0 0 0 1 0 0 1 1 0 0 1 0</float_array><technique_common>
<accessor source="#pa" count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<source id="u"><float_array id="ua" count="8">0 0 1 0 1 1 0 1</float_array><technique_common>
<accessor source="#ua" count="4" stride="2"><param name="S" type="float"/><param name="T" type="float"/></accessor>
</technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<polylist material="skin" count="1"><input semantic="VERTEX" source="#v" offset="0"/>
<input semantic="TEXCOORD" source="#u" offset="1" set="0"/><vcount>4</vcount><p>0 0 1 1 2 2 3 3</p></polylist>
</mesh></geometry></library_geometries>
<library_nodes><node id="leaf" name="leaf"><translate>0 0 3</translate>{_PLACED}</node></library_nodes>
<library_visual_scenes><visual_scene id="w"><node id="n1" name="tile.001"><rotate>0 0 1 30</rotate>{_PLACED}
<node id="n2" name="tile.002"><scale>2 2 2</scale>{_PLACED}</node><instance_node url="#leaf"/></node>
</visual_scene></library_visual_scenes><scene><instance_visual_scene url="#w"/></scene></COLLADA>"""


_PLACED = (
    '<instance_geometry url="#g"><bind_material><technique_common><instance_material symbol="skin" target="#m"/>'
    "</technique_common></bind_material></instance_geometry>"
)
