"""Serialize a scene out of the process that read its file."""

from __future__ import annotations

import io
import json
from typing import Any

import numpy as np

from stages.model_files.scene import ModelScene, Placement, SceneNode, Surface


def pack_scene(scene: ModelScene, **more: Any) -> bytes:
    """Return a scene as an npz file of plain arrays, which `unpack_scene` reads.

    more: further values that JSON can hold.
    """
    surfaces = scene.surfaces
    header = {
        "kind": scene.kind,
        "surfaces": [
            [surface.name, surface.materials, surface.face_material is not None, surface.paint is not None]
            for surface in surfaces
        ],
        "placements": [[place.name, place.label, place.surface, place.node] for place in scene.placements],
        "warnings": scene.warnings,
        "up": scene.up,
        "unit": scene.unit,
        "nodes": [[node.name, node.parent] for node in scene.nodes],
        "more": more,
    }
    no_material, no_paint = np.empty(0, np.int32), np.empty((0, 3), np.uint8)
    stream = io.BytesIO()
    np.savez(
        stream,
        header=np.frombuffer(json.dumps(header).encode(), np.uint8),
        poses=np.array([place.pose for place in scene.placements], dtype=np.float64),
        sizes=np.array([[len(surface.vertices), len(surface.faces)] for surface in surfaces], dtype=np.int64),
        vertices=np.concatenate([surface.vertices for surface in surfaces]),
        faces=np.concatenate([surface.faces for surface in surfaces]),
        face_colors=np.concatenate([surface.face_colors for surface in surfaces]),
        face_material=np.concatenate(
            [no_material, *(surface.face_material for surface in surfaces if surface.face_material is not None)]
        ),
        paint=np.concatenate([no_paint, *(surface.paint for surface in surfaces if surface.paint is not None)]),
    )
    return stream.getvalue()


def unpack_scene(content: bytes) -> tuple[ModelScene, dict[str, Any]]:
    """Return the scene that `pack_scene` has packed, and the further values.

    Raises ValueError for arrays that are no meshes: compiled code would follow a missing vertex out of bounds.
    """
    with np.load(io.BytesIO(content), allow_pickle=False) as stored:
        header: dict[str, Any] = json.loads(stored["header"].tobytes())
        arrays = {name: stored[name] for name in stored.files if name != "header"}
    dtypes = [arrays[name].dtype for name in ("poses", "vertices", "faces", "face_colors", "face_material", "paint")]
    if dtypes != [np.float64, np.float64, np.int32, np.uint8, np.int32, np.uint8] or not (
        np.isfinite(arrays["poses"]).all() and np.isfinite(arrays["vertices"]).all()
    ):
        raise ValueError("arrays have other types, or numbers that are not finite")
    at = dict.fromkeys(arrays, 0)

    def following(name: str, count: int) -> np.ndarray:
        at[name] += count
        rows: np.ndarray = arrays[name][at[name] - count : at[name]]
        return rows

    surfaces = []
    for (name, materials, has_material, has_paint), (vertex_count, face_count) in zip(
        header["surfaces"], arrays["sizes"].tolist(), strict=True
    ):
        vertices, faces = following("vertices", vertex_count), following("faces", face_count)
        if not len(faces) or faces.min() < 0 or faces.max() >= len(vertices):
            raise ValueError("a face has a vertex that does not exist")
        surfaces.append(
            Surface(
                name,
                vertices,
                faces,
                following("face_colors", face_count),
                tuple(materials),
                following("face_material", face_count) if has_material else None,
                following("paint", face_count) if has_paint else None,
            )
        )
    placements = [
        Placement(name, label, surface, pose, node)
        for (name, label, surface, node), pose in zip(header["placements"], arrays["poses"], strict=True)
    ]
    nodes = tuple(SceneNode(name, parent) for name, parent in header["nodes"])
    scene = ModelScene(
        header["kind"],
        tuple(surfaces),
        tuple(placements),
        tuple(header["warnings"]),
        header["up"],
        header["unit"],
        nodes,
    )
    return scene, header["more"]
