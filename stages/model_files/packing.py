"""Serialize a scene out of the process that read its file."""

from __future__ import annotations

import io
import json
from typing import Any

import numpy as np

from stages.model_files.scene import ModelScene, Placement, SceneNode, Surface
from stages.shape.appearance import (
    Appearance,
    TextureImage,
    describe_materials,
    restore_materials,
    shared_materials,
)
from stages.shape.arrays import ByteArray


def pack_scene(scene: ModelScene, **more: Any) -> bytes:
    """Return a scene as an npz file of plain arrays, which `unpack_scene` reads.

    more: further values that JSON can hold.
    """
    surfaces = scene.surfaces
    looks = [surface.appearance for surface in surfaces if surface.appearance is not None]
    shared, places = shared_materials(looks)
    materials, images = describe_materials(shared)
    header = {
        "kind": scene.kind,
        "surfaces": [
            [surface.name, surface.materials, surface.face_material is not None, surface.paint is not None]
            for surface in surfaces
        ],
        "looks": [
            None
            if surface.appearance is None
            else [surface.appearance.uv is not None, surface.appearance.normals is not None]
            for surface in surfaces
        ],
        "materials": materials,
        "images": len(images),
        "placements": [[place.name, place.label, place.surface, place.node] for place in scene.placements],
        "warnings": scene.warnings,
        "up": scene.up,
        "unit": scene.unit,
        "nodes": [[node.name, node.parent] for node in scene.nodes],
        "not_kept": scene.not_kept,
        "writer": scene.writer,
        "more": more,
    }
    no_material, no_paint = np.empty(0, np.int32), np.empty((0, 3), np.uint8)
    no_uv, no_normals = np.empty((0, 3, 2), np.float32), np.empty((0, 3, 3), np.float32)
    pixels: dict[str, Any] = {f"image{number}": image.pixels for number, image in enumerate(images)}
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
        look=np.concatenate(
            [no_material, *(place[look.face_material] for look, place in zip(looks, places, strict=True))]
        ),
        uv=np.concatenate([no_uv, *(look.uv for look in looks if look.uv is not None)]),
        normals=np.concatenate([no_normals, *(look.normals for look in looks if look.normals is not None)]),
        **pixels,
    )
    return stream.getvalue()


def unpack_scene(content: bytes) -> tuple[ModelScene, dict[str, Any]]:
    """Return the scene that `pack_scene` has packed, and the further values.

    Raises ValueError for arrays that are no meshes and no images: compiled code would follow a missing vertex out of
    bounds.
    """
    with np.load(io.BytesIO(content), allow_pickle=False) as stored:
        header: dict[str, Any] = json.loads(stored["header"].tobytes())
        arrays = {name: stored[name] for name in stored.files if name != "header"}
    numbers = [arrays[name] for name in ("poses", "vertices", "uv", "normals")]
    dtypes = [arrays[name].dtype for name in ("faces", "face_colors", "face_material", "paint", "look")]
    if (
        [array.dtype for array in numbers] != [np.float64, np.float64, np.float32, np.float32]
        or dtypes != [np.int32, np.uint8, np.int32, np.uint8, np.int32]
        or not all(np.isfinite(array).all() for array in numbers)
    ):
        raise ValueError("arrays have other types, or numbers that are not finite")
    images = [TextureImage.of(_image(arrays[f"image{number}"])) for number in range(header["images"])]
    materials_of_looks = restore_materials(header["materials"], images)
    if len(arrays["look"]) and not -1 <= arrays["look"].min() <= arrays["look"].max() < len(materials_of_looks):
        raise ValueError("a face has a material that does not exist")
    at = dict.fromkeys(arrays, 0)

    def following(name: str, count: int) -> np.ndarray:
        at[name] += count
        rows: np.ndarray = arrays[name][at[name] - count : at[name]]
        return rows

    surfaces = []
    for (name, materials, has_material, has_paint), has_look, (vertex_count, face_count) in zip(
        header["surfaces"], header["looks"], arrays["sizes"].tolist(), strict=True
    ):
        vertices, faces = following("vertices", vertex_count), following("faces", face_count)
        if not len(faces) or faces.min() < 0 or faces.max() >= len(vertices):
            raise ValueError("a face has a vertex that does not exist")
        look = None
        if has_look is not None:
            has_uv, has_normals = has_look
            look = Appearance(
                materials_of_looks,
                following("look", face_count),
                following("uv", face_count) if has_uv else None,
                following("normals", face_count) if has_normals else None,
            )
        surfaces.append(
            Surface(
                name,
                vertices,
                faces,
                following("face_colors", face_count),
                tuple(materials),
                following("face_material", face_count) if has_material else None,
                following("paint", face_count) if has_paint else None,
                look,
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
        tuple(header["not_kept"]),
        header["writer"],
    )
    return scene, header["more"]


def _image(pixels: np.ndarray) -> ByteArray:
    """Return the pixels of a texture. Raises ValueError for an array that holds no pixels."""
    if pixels.dtype != np.uint8 or pixels.ndim != 3 or pixels.shape[2] not in (3, 4) or not pixels.size:
        raise ValueError("an image has no pixels")
    return pixels
