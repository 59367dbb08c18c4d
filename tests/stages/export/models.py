"""Models for the tests of exports: a cabinet of the library, and a table with a loose ball."""

from __future__ import annotations

from functools import cache

import numpy as np
import trimesh

from stages.export.model import SimulationModel, simulation_model
from stages.export.settings import ExportSettings
from stages.programs.program import build_shape, find_program
from stages.shape.geometry.bounds import shape_bounds
from stages.shape.kit import Assembly, PartMesh
from stages.shape.physics.judge import judge_of
from stages.shape.physics.settings import PhysicsConfig
from stages.shape.shape import Shape

CLOSED_CABINET = {"column_count": 2, "open_columns": 1, "drawer_rows": 2, "has_inset_fronts": True}


def connected(shape: Shape) -> np.ndarray:
    """Return the pairs of parts that statics connects."""
    return judge_of(shape.meshes, shape.up, PhysicsConfig()).validity(shape.assembly).joints


@cache
def cabinet() -> Shape:
    """A cabinet with an open column, and a column with two drawers and a door."""
    program = find_program("cabinet")
    return build_shape(program, program.schema.complete(CLOSED_CABINET))


@cache
def cabinet_model(settings: ExportSettings) -> SimulationModel:
    """The cabinet as links and joints."""
    return simulation_model("cabinet", cabinet(), connected(cabinet()), settings)


def mesh(name: str, solid: trimesh.Trimesh) -> PartMesh:
    """A mesh of trimesh as the surface of a part."""
    faces = np.asarray(solid.faces, dtype=np.int32)
    return PartMesh(name, np.asarray(solid.vertices), faces, np.full((len(faces), 3), 120, np.uint8))


def two_pieces() -> tuple[Shape, np.ndarray]:
    """A block with a plate on it, and a second block apart; y up, with pairs of parts that hold together."""
    meshes = (
        mesh("block", trimesh.creation.box((1.0, 1.0, 1.0))),
        mesh("plate & top", trimesh.creation.box((2.0, 0.2, 2.0))),
    )
    poses = np.tile(np.eye(4), (3, 1, 1))
    poses[:, :3, 3] = [(0.0, 5.5, 0.0), (0.0, 6.1, 0.0), (5.0, 5.5, 1.0)]
    assembly = Assembly(np.array([0, 1, 0], np.int16), poses, np.empty((0, 2), np.int32))
    return Shape(meshes, assembly, "y", ("block", "plate & top")), np.array([[0, 1]], dtype=np.int32)


def height(shape: Shape) -> float:
    """Height of a shape, y up."""
    low, high = shape_bounds(shape)
    return float(high[1] - low[1])
