"""Small surfaces for the tests of stage `surface`."""

from __future__ import annotations

import numpy as np
import trimesh

from stages.shape.kit import Assembly, PartMesh
from stages.shape.shape import Shape

TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])


def surface(vertices: np.ndarray | list[tuple[float, float, float]], faces: np.ndarray | list[list[int]]) -> PartMesh:
    """A surface of vertices and faces."""
    triangles = np.asarray(faces, dtype=np.int32)
    return PartMesh("part", np.asarray(vertices, dtype=np.float64), triangles, np.zeros((len(triangles), 3), np.uint8))


def of_solid(solid: trimesh.Trimesh) -> PartMesh:
    """The surface of a mesh of trimesh."""
    return surface(np.asarray(solid.vertices), np.asarray(solid.faces))


def shape_of(*solids: trimesh.Trimesh) -> Shape:
    """A shape of one part for each solid, in its place."""
    poses = np.tile(np.eye(4), (len(solids), 1, 1))
    assembly = Assembly(np.arange(len(solids), dtype=np.int16), poses, np.empty((0, 2), np.int32))
    return Shape(tuple(map(of_solid, solids)), assembly, "y", ("part",))


def box(size: tuple[float, float, float], centre: tuple[float, float, float]) -> trimesh.Trimesh:
    """A box of trimesh."""
    return trimesh.creation.box(size, trimesh.transformations.translation_matrix(centre))
