"""What a model file holds, as our readers and as those of two other libraries read it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from stages.model_files.colors import color_bytes, srgb_from_linear
from stages.model_files.scene_file import read_scene


@dataclass(frozen=True)
class Contents:
    """What one reader finds in a file, in the world.

    points: number of distinct positions of face corners.
    colors: shown colours, sRGB.
    is_textured: whether materials have textures, or vertices colours, which go before the colours of materials.
    """

    triangles: int
    points: int
    low: np.ndarray
    high: np.ndarray
    area: float
    volume: float
    names: frozenset[str]
    materials: frozenset[str]
    colors: frozenset[tuple[int, ...]]
    is_textured: bool = False


def contents(corners: np.ndarray, names: Any = (), materials: Any = (), colors: Any = ()) -> Contents:
    """Return the contents of triangles, float64 (t, 3, 3); triangles whose corners are not distinct do not count."""
    a, b, c = np.moveaxis(corners, 1, 0)
    is_distinct = (a != b).any(axis=1) & (b != c).any(axis=1) & (c != a).any(axis=1)
    a, b, c = a[is_distinct], b[is_distinct], c[is_distinct]
    points = corners[is_distinct].reshape(-1, 3)
    return Contents(
        triangles=len(a),
        points=len(np.unique(points.astype(np.float32) + np.float32(0), axis=0)),
        low=points.min(axis=0),
        high=points.max(axis=0),
        area=float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2),
        volume=float(np.einsum("ij,ij->", a - points.mean(axis=0), np.cross(b - a, c - a)) / 6),
        names=frozenset(names),
        materials=frozenset(materials),
        colors=frozenset(colors),
    )


def read_ours(path: Path) -> Contents:
    scene = read_scene(path)
    corners, materials, colors = [], set(), set()
    for place in scene.placements:
        surface = scene.surfaces[place.surface]
        points = surface.vertices @ place.pose[:3, :3].T + place.pose[:3, 3]
        corners.append(points[surface.faces])
        if surface.face_material is not None:
            used = np.unique(surface.face_material)
            materials |= {surface.materials[index] for index in used[used >= 0].tolist()}
        colors |= set(map(tuple, np.unique(surface.face_colors, axis=0).tolist()))
    return contents(np.concatenate(corners), (place.name for place in scene.placements), materials, colors)


def read_trimesh(path: Path) -> Contents:
    import trimesh

    more = {"split_object": True, "group_material": False} if path.suffix.lower() == ".obj" else {}
    scene = trimesh.load_scene(path, process=False, **more)
    corners, names, materials, colors = [], set(), set(), set()
    is_textured = False
    for node in scene.graph.nodes_geometry:
        matrix, geometry = scene.graph[node]
        mesh = scene.geometry[geometry]
        if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces):
            corners.append(trimesh.transform_points(mesh.vertices, matrix)[mesh.faces])
            names.add(geometry)
            material = getattr(mesh.visual, "material", None)
            is_textured |= mesh.visual.kind in ("vertex", "face") or any(
                getattr(material, key, None) is not None for key in ("image", "baseColorTexture")
            )
            if getattr(material, "name", None):
                materials.add(material.name)
            if getattr(material, "main_color", None) is not None:
                colors.add(tuple(material.main_color[:3].tolist()))
    return replace(contents(np.concatenate(corners), names, materials, colors), is_textured=is_textured)


def read_assimp(path: Path) -> Contents:
    """Read through assimp-py, which is not among our dependencies: `pip install assimp-py`."""
    import assimp_py

    scene = assimp_py.import_file(str(path), assimp_py.Process_Triangulate)
    corners: list[np.ndarray] = []
    names, materials, colors = set(), set(), set()
    more: list[bool] = []

    def visit(node: Any, parent: np.ndarray) -> None:
        matrix = parent @ np.array(node.transformation, dtype=np.float64).reshape(4, 4)
        for index in node.mesh_indices:
            mesh = scene.meshes[index]
            points = np.asarray(mesh.vertices, dtype=np.float64).reshape(-1, 3)
            if mesh.num_indices and mesh.num_indices == 3 * mesh.num_faces:
                moved = points @ matrix[:3, :3].T + matrix[:3, 3]
                corners.append(moved[np.asarray(mesh.indices, dtype=np.int64).reshape(-1, 3)])
                names.update({node.name, mesh.name})
                material = scene.materials[mesh.material_index]
                materials.add(material.get("NAME", ""))
                diffuse = np.array(material.get("COLOR_DIFFUSE", (0.6, 0.6, 0.6)))[:3]
                is_linear = path.suffix.lower() in (".glb", ".gltf")
                colors.add(tuple((srgb_from_linear(diffuse) if is_linear else color_bytes(diffuse)).tolist()))
                more.append(bool(material.get("TEXTURES")) or bool(mesh.colors))
        for child in node.children:
            visit(child, matrix)

    visit(scene.root_node, np.eye(4))
    return replace(contents(np.concatenate(corners), names, materials, colors), is_textured=any(more))


PEERS: Mapping[str, Callable[[Path], Contents]] = {"trimesh": read_trimesh, "assimp": read_assimp}
