"""A dresser of boxes whose captions are known."""

from __future__ import annotations

from typing import Any

import numpy as np
import trimesh

from stages.captions.facts import ShapeFacts
from stages.captions.placement import ShapePlacement
from stages.captions.words import label_nouns
from stages.shape.kit import Assembly, PartMesh
from stages.shape.shape import Shape

PHYSICS: dict[str, Any] = {"rooted": True, "stable": True, "tipping_degrees": 12.4, "symmetry": 1.0, "floating": 0}
CONTACTS = np.array([[0, leg] for leg in (1, 2, 3, 4)] + [[0, drawer] for drawer in range(5, 11)], dtype=np.int32)
LABELS = ("body", "leg_front", "Front/drawer")


def box_mesh(label: str, size: tuple[float, float, float], color: tuple[int, int, int]) -> PartMesh:
    """A box of one colour around the origin."""
    solid = trimesh.creation.box(size)
    colors = np.tile(np.array(color, np.uint8), (12, 1))
    return PartMesh(label, np.asarray(solid.vertices), np.asarray(solid.faces, dtype=np.int32), colors)


def dresser(shift: float = 0.0) -> Shape:
    """A body on four legs with six drawers in two columns of three; `shift` moves the last drawer up."""
    meshes = (
        box_mesh("body", (1.0, 0.9, 0.4), (120, 80, 40)),
        box_mesh("leg_front", (0.05, 0.1, 0.05), (20, 20, 20)),
        box_mesh("Front/drawer", (0.4, 0.25, 0.02), (250, 250, 250)),
    )
    places = [(0.0, 0.55, 0.0), *((x, 0.05, z) for x in (-0.4, 0.4) for z in (-0.1, 0.1))]
    places += [(x, y, 0.21) for x in (-0.25, 0.25) for y in (0.25, 0.55, 0.85)]
    poses = np.tile(np.eye(4), (11, 1, 1))
    poses[:, :3, 3] = places
    poses[10, 1, 3] += shift
    types = np.array([0, *[1] * 4, *[2] * 6], np.int16)
    return Shape(meshes, Assembly(types, poses, np.empty((0, 2), np.int32)), "y", LABELS)


def facts(shape: Shape, **physics: Any) -> ShapeFacts:
    """The dresser ready for facts; its front is known."""
    return ShapeFacts.of(
        shape, CONTACTS, {**PHYSICS, **physics}, label_nouns(shape.labels), placement=ShapePlacement(front_known=True)
    )
