"""A model as read from its file, and its serialization out of the process that read the file."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from stages.exemplars.settings import Segmentation
from stages.model_files.packing import pack_scene, unpack_scene
from stages.model_files.scene import ModelScene, Placement, SceneNode, Surface
from stages.shape.appearance import Appearance
from stages.shape.arrays import ByteArray, FloatArray, IntArray

STATED_IN_CONFIG = "as the config says"
"""Why a model has its parts if the config states their source."""


@dataclass(frozen=True)
class RawPart:
    """One part as read from a file.

    name: unique in the model.
    mesh_name: equal exactly for parts that share a mesh and its scale; their arrays are then the same objects.
    label: the file's label for the part's type, if any.
    pose: float64 (4, 4), rigid, determinant +1.
    vertices: float64 (v, 3) in part coordinates, the origin in the middle of the part's box.
    faces: int32 (f, 3).
    face_colors: uint8 (f, 3) sRGB.
    appearance: materials, texture coordinates and normals, if the file has them and they are kept.
    node: the node of the model that places it, for a format with a node tree.
    """

    name: str
    mesh_name: str
    label: str | None
    pose: FloatArray
    vertices: FloatArray
    faces: IntArray
    face_colors: ByteArray
    appearance: Appearance | None = None
    node: int | None = None


@dataclass(frozen=True)
class Model:
    """The parts of a model file in the file's order.

    segmentation: the source of the parts, what `auto` picked.
    why: the reason, a sentence.
    warnings: a sentence each.
    up: the axis that points up as the file states it, if its format lets files choose.
    unit: metres of one unit of the coordinates, if the format or the file says.
    nodes: the node tree, parents before their children; empty for formats without one.
    writer: the program that wrote the file, as the file states it, else empty.
    """

    path: Path
    parts: tuple[RawPart, ...]
    segmentation: Segmentation
    why: str
    warnings: tuple[str, ...]
    up: Literal["y", "z"] | None = None
    unit: float | None = None
    nodes: tuple[SceneNode, ...] = ()
    writer: str = ""

    @property
    def shows_more_than_colors(self) -> bool:
        """Whether a part has a texture, or a material that is not opaque."""
        looks = [part.appearance for part in self.parts if part.appearance is not None]
        materials = [material for look in looks for material in look.materials]
        return any(material.textures or material.alpha_mode != "opaque" for material in materials)

    def with_colors_alone(self) -> Model:
        """Return the model with one colour a face."""
        return replace(self, parts=tuple(replace(part, appearance=None) for part in self.parts))

    @property
    def is_cut(self) -> bool:
        """Whether its parts are pieces of one surface, which continues across their contacts."""
        return self.segmentation in ("symmetry", "sections")


def pack_model(model: Model) -> bytes:
    """Return a model without its path as bytes, which `unpack_model` reads."""
    meshes = {part.mesh_name: part for part in model.parts}
    index_of = {name: index for index, name in enumerate(meshes)}
    scene = ModelScene(
        "objects",
        tuple(
            Surface(name, mesh.vertices, mesh.faces, mesh.face_colors, appearance=mesh.appearance)
            for name, mesh in meshes.items()
        ),
        tuple(Placement(part.name, part.label, index_of[part.mesh_name], part.pose, part.node) for part in model.parts),
        model.warnings,
        model.up,
        model.unit,
        model.nodes,
        writer=model.writer,
    )
    return pack_scene(scene, segmentation=model.segmentation, why=model.why)


def unpack_model(path: Path, content: bytes) -> Model:
    """Return the model that `pack_model` has packed, as that of the file `path`.

    Raises ValueError for arrays that are no meshes.
    """
    scene, stated = unpack_scene(content)
    meshes = scene.surfaces
    parts = [
        RawPart(
            *(part.name, mesh.name, part.label, part.pose, mesh.vertices, mesh.faces, mesh.face_colors),
            *(mesh.appearance, part.node),
        )
        for part, mesh in ((placement, meshes[placement.surface]) for placement in scene.placements)
    ]
    return Model(
        *(path, tuple(parts), stated["segmentation"], stated["why"], scene.warnings, scene.up, scene.unit, scene.nodes),
        writer=scene.writer,
    )
