"""One table of five boxes in every format and encoding that is read."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from tests.stages.exemplars.model_files import BOX_FACES, Glb, box, write_obj

SIZE = (1.2, 0.76, 0.8)
BOXES = {
    "top": box((1.2, 0.06, 0.8), (-0.6, 0.7, -0.4)),
    **{
        f"leg_{number}": box((0.06, 0.7, 0.06), (x, 0.0, z))
        for number, (x, z) in enumerate([(-0.58, -0.38), (0.52, -0.38), (0.52, 0.32), (-0.58, 0.32)])
    },
}


def write_one_table(folder: Path) -> list[Path]:
    """Write the table, y up, in metres, in eleven files; return them, a plain GLB first."""
    import trimesh

    written = [
        _plain().write(folder / "plain.glb"),
        _quantised().write(folder / "quantised.glb"),
        _sparse().write(folder / "sparse.glb"),
        _apart(folder),
        _negative_obj(folder / "negative.obj"),
    ]
    meshes = {name: trimesh.Trimesh(corners, BOX_FACES, process=False) for name, corners in BOXES.items()}
    joined = trimesh.util.concatenate(list(meshes.values()))
    contents = {
        "text.ply": joined.export(file_type="ply", encoding="ascii"),
        "binary.ply": joined.export(file_type="ply"),
        "text.stl": joined.export(file_type="stl_ascii").encode(),
        "binary.stl": joined.export(file_type="stl"),
        "text.off": joined.export(file_type="off").encode(),
        "scene.dae": trimesh.exchange.dae.export_collada(list(meshes.values())),
    }
    for name, content in contents.items():
        (folder / name).write_bytes(content)
    return [*written, *(folder / name for name in contents)]


def _plain() -> Glb:
    """Each part around its own origin, moved by its node."""
    glb = Glb()
    for name, corners in BOXES.items():
        middle = corners.mean(axis=0)
        glb.node(name=name, mesh=glb.mesh(glb.primitive(corners - middle, BOX_FACES)), translation=middle.tolist())
    return glb


def _quantised() -> Glb:
    """Normalised 16-bit positions, scaled by nodes."""
    glb = Glb()
    for name, corners in BOXES.items():
        primitive = glb.primitive(corners, BOX_FACES)
        low, size = corners.min(axis=0), np.ptp(corners, axis=0)
        steps = np.zeros((8, 4), "<u2")  # four, so that vertices begin at multiples of four bytes
        steps[:, :3] = np.rint((corners - low) / size * 65535)
        position = glb.header["accessors"][primitive["attributes"]["POSITION"]]
        position.update(bufferView=glb.view(steps.tobytes()), componentType=5123, normalized=True)
        glb.header["bufferViews"][-1]["byteStride"] = 8
        glb.node(name=name, mesh=glb.mesh(primitive), translation=low.tolist(), scale=size.tolist())
    return glb


def _sparse() -> Glb:
    """Positions without a buffer view: zeros, all replaced by sparse values."""
    glb = Glb()
    for name, corners in BOXES.items():
        primitive = glb.primitive(corners, BOX_FACES)
        position = glb.header["accessors"][primitive["attributes"]["POSITION"]]
        del position["bufferView"]
        position["sparse"] = {
            "count": 8,
            "indices": {"bufferView": glb.view(np.arange(8, dtype="<u2").tobytes()), "componentType": 5123},
            "values": {"bufferView": glb.view(corners.astype("<f4").tobytes())},
        }
        glb.node(name=name, mesh=glb.mesh(primitive))
    return glb


def _apart(folder: Path) -> Path:
    """A text header next to a buffer."""
    glb = _plain()
    (folder / "apart.bin").write_bytes(glb.chunk)
    header = {**glb.header, "buffers": [{"byteLength": len(glb.chunk), "uri": "apart.bin"}]}
    (folder / "apart.gltf").write_text(json.dumps(header), encoding="utf-8")
    return folder / "apart.gltf"


def _negative_obj(path: Path) -> Path:
    """Faces by relative indices."""
    write_obj(path, BOXES)
    lines, count = [], 0
    for line in path.read_text(encoding="utf-8").splitlines():
        count += line.startswith("v ")
        words = line.split()
        if line.startswith("f "):
            words[1:] = [str(int(word) - 1 - count) for word in words[1:]]
        lines.append(" ".join(words))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
