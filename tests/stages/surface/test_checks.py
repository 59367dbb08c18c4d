"""Exact facts about surfaces: literal cases, and Open3D and trimesh on others."""

from __future__ import annotations

from typing import Any

import numpy as np
import open3d as o3d
import pytest
import trimesh

from stages.programs.program import build_shape, find_program
from stages.surface.checks import SurfaceFlags, surface_flags
from tests.stages.surface.solids import TETRAHEDRON, box, of_solid, surface

CORNERS = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])


def joined(*parts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Tetrahedra with the given corners in one mesh."""
    faces = np.concatenate([TETRAHEDRON + 4 * index for index in range(len(parts))])
    return np.concatenate(parts), faces


UNIT = of_solid(box((1, 1, 1), (0, 0, 0)))
FLIPPED = np.where(np.arange(12)[:, None] == 5, UNIT.faces[:, ::-1], UNIT.faces)
CASES = {
    "a box": (UNIT.vertices, UNIT.faces, (True, True, False)),
    "a box without a face": (UNIT.vertices, UNIT.faces[1:], (False, True, False)),
    "a box with a face turned around": (UNIT.vertices, FLIPPED, (False, False, False)),
    "a box with a face twice": (UNIT.vertices, UNIT.faces[[0, *range(12)]], (False, False, True)),
    "two tetrahedra that share a vertex": (*joined(CORNERS, -CORNERS[:, [1, 0, 2]]), (True, False, False)),
    "two tetrahedra that share an edge": (*joined(CORNERS, CORNERS * [1, -1, -1]), (True, False, False)),
    "a vertex that touches a face": (*joined(CORNERS, -CORNERS[:, [1, 0, 2]] + [0.2, 0.2, 0]), (True, True, True)),
    "two tetrahedra a last digit apart": (
        *joined(CORNERS, -CORNERS[:, [1, 0, 2]] + [0.25, 0.25, -np.float64(np.spacing(np.float32(1e-30)))]),
        (True, True, False),
    ),
    "two tetrahedra that overlap": (*joined(CORNERS, CORNERS + 0.1), (True, True, True)),
    "two faces folded onto each other": (
        [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0.3, 0.4, 0)],
        [[0, 1, 2], [1, 0, 3]],
        (False, True, True),
    ),
    "two faces of a plane": (
        [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0.3, -0.4, 0)],
        [[0, 1, 2], [1, 0, 3]],
        (False, True, False),
    ),
    "two faces that cross at a shared vertex": (
        [(0, 0, 0), (2, 1, 0), (2, -1, 0), (1, 0, 1), (1, 0, -1)],
        [[0, 1, 2], [0, 3, 4]],
        (False, False, True),
    ),
    "a face without area": (
        [(0, 0, 0), (1, 0, 0), (0, 1, 0), (2, 0, 0)],
        [[0, 1, 2], [0, 1, 3]],
        (False, False, False),
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_literal_surfaces_are_what_they_are(name: str) -> None:
    vertices, faces, expected = CASES[name]
    assert surface_flags(surface(vertices, faces)) == SurfaceFlags(*expected)


def test_vertices_at_one_place_are_one_vertex() -> None:
    loose = box((1, 1, 1), (0, 0, 0))
    loose.unmerge_vertices()
    assert len(loose.vertices) == 36
    assert surface_flags(of_solid(loose)) == SurfaceFlags(closed=True, manifold=True, self_intersecting=False)


def in_open3d(vertices: np.ndarray, faces: np.ndarray) -> Any:
    return o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(vertices), o3d.utility.Vector3iVector(faces.astype(np.int32))
    )


@pytest.mark.parametrize("seed", range(30))
def test_random_triangles_intersect_where_open3d_finds_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    vertices = rng.normal(size=(12, 3)).astype(np.float32).astype(np.float64)
    faces = np.arange(12, dtype=np.int32).reshape(4, 3)[: 2 + seed % 3]
    found = surface_flags(surface(vertices, faces)).self_intersecting
    assert found == in_open3d(vertices, faces).is_self_intersecting()


@pytest.mark.parametrize("program", ["chair", "cabinet"])
def test_parts_of_programs_are_as_two_libraries_find_them(program: str) -> None:
    found = find_program(program)
    for mesh in build_shape(found, found.schema.complete({})).meshes:
        flags = surface_flags(mesh)
        solid = trimesh.Trimesh(mesh.vertices, mesh.faces)
        assert flags.closed == (solid.is_watertight and solid.is_winding_consistent), mesh.name
        peer = in_open3d(np.asarray(solid.vertices), np.asarray(solid.faces))
        assert flags.manifold == (peer.is_edge_manifold() and peer.is_vertex_manifold()), mesh.name
