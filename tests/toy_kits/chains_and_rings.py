"""Small kits whose languages are known by heart: chains of links, and rectangular rings of one-way road."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from stages.exemplars.build import build_kit
from stages.exemplars.model import Model, RawPart
from stages.exemplars.settings import STRICTEST, ContactConfig, KitConfig
from stages.shape.arrays import FloatArray
from stages.shape.kit import Kit

Placed = tuple[str, FloatArray]


def pose(x: float, y: float, z: float, quarter_turns: int = 0) -> FloatArray:
    """A place and a turn about the vertical y axis."""
    turned = np.round(trimesh.transformations.rotation_matrix(quarter_turns * np.pi / 2, [0, 1, 0]))
    turned[:3, 3] = x, y, z
    return turned


def box(*size: float) -> trimesh.Trimesh:
    return trimesh.creation.box(size)


def with_arrow(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """The mesh with a fin towards +x on top, which leaves it no symmetry but a reflection."""
    fin = trimesh.Trimesh([[0, 0.1, 0], [0.3, 0.1, 0], [0, 0.4, 0]], [[0, 1, 2]], process=False)
    return trimesh.util.concatenate([mesh, fin])


def models_of(meshes: dict[str, trimesh.Trimesh], shapes: Sequence[Sequence[Placed]]) -> list[Model]:
    """Shapes made of named meshes, as if they had been read from files."""
    models = []
    for number, shape in enumerate(shapes):
        parts = tuple(
            RawPart(
                name=f"{name}.{index:03d}",
                mesh_name=name,
                label=name,
                pose=at,
                vertices=np.array(meshes[name].vertices, dtype=np.float64),
                faces=np.array(meshes[name].faces, dtype=np.int32),
                face_colors=np.full((len(meshes[name].faces), 3), 128, dtype=np.uint8),
            )
            for index, (name, at) in enumerate(shape)
        )
        models.append(Model(Path(f"shape{number}.glb"), parts, "nodes", "one part a node", ()))
    return models


def config_of(shapes: Sequence[Sequence[Placed]], kinds: Sequence[str] = ("face",)) -> KitConfig:
    """Return the config of a kit of some shapes, with every setting stated."""
    return KitConfig(
        name="toy",
        shapes=tuple(Path(__file__) for _ in shapes),
        contact=ContactConfig(kinds=tuple(kinds)),  # type: ignore[arg-type]
    ).resolve(STRICTEST)


def kit_of(
    meshes: dict[str, trimesh.Trimesh],
    shapes: Sequence[Sequence[Placed]],
    kinds: Sequence[str] = ("face",),
    **changed: Any,
) -> Kit:
    """The kit of shapes made of named meshes, through the real path from models to kits, with `changed` keys."""
    kit, _ = build_kit(config_of(shapes, kinds).model_copy(update=changed), models_of(meshes, shapes))
    return kit


def write_model(path: Path, meshes: dict[str, trimesh.Trimesh], shape: Sequence[Placed]) -> str:
    """A GLB with a node for each part of a shape made of named meshes; its path."""
    scene = trimesh.Scene()
    for number, (name, at) in enumerate(shape):
        scene.add_geometry(meshes[name], node_name=f"{name}.{number:03d}", geom_name=name, transform=at)
    path.write_bytes(scene.export(file_type="glb"))
    return str(path)


CHAIN = {"cap": box(0.5, 1.0, 1.0), "link": with_arrow(box(1.0, 0.2, 0.6))}


def chain(links: int) -> list[Placed]:
    """cap - link - ... - link - cap along x."""
    row = [("link", pose(index, 0, 0)) for index in range(links)]
    return [("cap", pose(-0.75, 0, 0)), *row, ("cap", pose(links - 0.25, 0, 0))]


ROAD = {"straight": with_arrow(box(1.0, 0.2, 0.6)), "corner": with_arrow(box(1.0, 0.2, 1.0))}


def ring(width: int, depth: int) -> list[Placed]:
    """A closed one-way rectangle of tiles: four corners, and straights between them along +x, -z, -x, +z."""
    parts: list[Placed] = []
    x, z = 0, 0
    for side, length in enumerate((width, depth, width, depth)):
        step = ((1, 0), (0, -1), (-1, 0), (0, 1))[side]
        parts.append(("corner", pose(x, 0, z, side)))
        for _ in range(length):
            x, z = x + step[0], z + step[1]
            parts.append(("straight", pose(x, 0, z, side)))
        x, z = x + step[0], z + step[1]
    return parts
