"""Small valid model files of every format, from which hostile ones are made."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from tests.stages.exemplars.model_files import BOX_FACES, Glb, box, png, textured_dae, textured_glb, write_obj

BOXES = {"base": box((4, 1, 4)), "roof": box((2, 0.5, 2), (0.5, 1, 0.5))}


def write_good(folder: Path) -> list[Path]:
    """Write valid files and the files that they name into `folder`; return the model files in a fixed order."""
    import trimesh

    (folder / "skin.png").write_bytes(png(np.arange(48).reshape(4, 4, 3) * 5))
    (folder / "skin.mtl").write_text(
        "newmtl red\nKd 1 0 0\nnewmtl skin\nKd 1 1 1\nmap_Kd -s 1 1 1 skin.png\n", encoding="utf-8"
    )
    glb = _glb()
    (folder / "all.bin").write_bytes(glb.chunk)
    header = {**glb.header, "buffers": [{"byteLength": len(glb.chunk), "uri": "all.bin"}]}
    (folder / "apart.gltf").write_text(json.dumps(header), encoding="utf-8")
    textured_glb("skin.png").write(folder / "skin.glb")
    glb.write(folder / "whole.glb")
    write_obj(folder / "boxes.obj", BOXES, "mtllib skin.mtl\nvt 0 0\nvt 1 0\nvt 0 1", {"roof": "usemtl red"})
    with open(folder / "boxes.obj", "a", encoding="utf-8") as stream:
        stream.write(
            "o card\nusemtl skin\nv 9 0 0\nv 9 1 0\nv 9 1 1\nv 9 0 1 0.5 0.5 0.5\nf 17/1 18/2 19/3\nf -1 -2 -3 -4\n"
        )
    (folder / "tiles.dae").write_text(textured_dae("skin.png"), encoding="utf-8")
    mesh = trimesh.util.concatenate([trimesh.Trimesh(item, BOX_FACES, process=False) for item in BOXES.values()])
    mesh.visual.face_colors = [255, 51, 0, 255]
    mesh.export(folder / "binary.ply")
    (folder / "text.ply").write_bytes(mesh.export(file_type="ply", encoding="ascii"))
    (folder / "skin.ply").write_text(_TEXTURED_PLY, encoding="utf-8")
    mesh.export(folder / "binary.stl")
    (folder / "text.stl").write_text(
        "".join(
            trimesh.Trimesh(item, BOX_FACES, process=False)
            .export(file_type="stl_ascii")
            .replace("solid", f"solid {name}", 1)
            + "\n"
            for name, item in BOXES.items()
        ),
        encoding="utf-8",
    )
    mesh.export(folder / "boxes.off")
    return sorted(path for path in folder.iterdir() if path.suffix not in (".png", ".mtl", ".bin"))


def _glb() -> Glb:
    """Nodes in nodes, a strip, vertex colours, sparse and quantised accessors, an image inside."""
    glb = Glb()
    image = glb.view(png(np.full((2, 2, 3), 90)))
    glb.header["images"] = [{"bufferView": image, "mimeType": "image/png"}]
    glb.header["textures"] = [{"source": 0}]
    skin = {"name": "skin", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 0}}}
    glb.header["materials"] = [skin]
    plain = glb.primitive(BOXES["base"], BOX_FACES, material=0)
    plain["attributes"]["TEXCOORD_0"] = glb.accessor(box()[:, :2].astype("<f4"))
    colored = glb.primitive(BOXES["roof"], BOX_FACES)
    colored["attributes"]["COLOR_0"] = glb.accessor(np.full((8, 4), 200, "<u1"), normalized=True)
    glb.header["accessors"][colored["attributes"]["POSITION"]]["sparse"] = {
        "count": 1,
        "indices": {"bufferView": glb.view(np.array([6], "<u2").tobytes()), "componentType": 5123},
        "values": {"bufferView": glb.view(np.array([[3, 2, 3]], "<f4").tobytes())},
    }
    square = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], "<f4")
    strip = {"attributes": {"POSITION": glb.accessor(square)}, "mode": 5}
    base, roof = glb.mesh(plain, name="base"), glb.mesh(colored, strip, name="roof")
    leaf = glb.node(root=False, name="leaf.001", mesh=roof, rotation=[0, 0.6, 0, 0.8], scale=[1, 2, 1])
    glb.node(name="trunk", mesh=base, children=[leaf], translation=[1, 2, 3])
    glb.node(name="leaf.002", mesh=roof, matrix=np.eye(4).ravel().tolist())
    return glb


_TEXTURED_PLY = """ply
format ascii 1.0
comment TextureFile skin.png
element vertex 4
property float x
property float y
property float z
property float s
property float t
element face 2
property list uchar int vertex_indices
property list uchar float texcoord
property uchar red
property uchar green
property uchar blue
end_header
0 0 0 0 0
1 0 0 1 0
1 1 0 1 1
0 1 0 0 1
3 0 1 2 6 0 0 1 0 1 1 255 0 0
4 0 1 2 3 8 0 0 1 0 1 1 0 1 0 255 0
"""
