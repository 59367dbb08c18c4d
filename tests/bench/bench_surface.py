"""Facts about surfaces, unions, signed distances and captions of cabinets; peers: Open3D and trimesh."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from stages.captions.compose import captions
from stages.captions.facts import ShapeFacts
from stages.captions.placement import ShapePlacement
from stages.captions.words import label_nouns
from stages.programs.files import random_shapes
from stages.programs.program import build_shape, find_program
from stages.surface.checks import surface_flags
from stages.surface.distances import cube_around, distance_points, occupancy_grid, signed_distances
from stages.surface.settings import DistanceConfig
from stages.surface.union import solids_of, union_mesh
from tests.bench.measure import Measure, rate

POINT_COUNT, CELL_COUNT = 2000, 32
STATICS = {"rooted": True, "stable": True, "tipping_degrees": 12.4, "symmetry": 1.0}


def bench() -> Iterator[Measure]:
    """Shapes per second and core. Open3D computes in 32 bits, and is wrong by a thousandth of the shape in places."""
    import open3d
    import trimesh

    program = find_program("cabinet")
    shape = build_shape(program, random_shapes(program, 1, seed=3)[0])
    note = f"a cabinet of {len(shape)} parts"
    solids = solids_of(shape)
    union = union_mesh(solids)
    cube = cube_around(union, 0.05)
    points = distance_points(union, cube, DistanceConfig(near=POINT_COUNT // 2, uniform=POINT_COUNT // 2), _rng())
    solid = trimesh.Trimesh(union.vertices, union.faces, process=False)
    scene = open3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(
        open3d.core.Tensor(union.vertices.astype(np.float32)), open3d.core.Tensor(union.faces.astype(np.uint32))
    )

    def flags() -> int:
        return len({surface_flags.__wrapped__(mesh) for mesh in shape.meshes}) and 1

    def open3d_distances() -> int:
        return len(scene.compute_signed_distance(open3d.core.Tensor(points), nthreads=1)) // POINT_COUNT

    def trimesh_distances() -> int:
        return len(trimesh.proximity.signed_distance(solid, points.astype(np.float64))) // POINT_COUNT

    facts = ShapeFacts.of(
        shape,
        np.empty((0, 2), np.int32),
        STATICS,
        label_nouns(shape.labels),
        placement=ShapePlacement(front_known=True),
    )
    yield Measure("surface, exact flags", "shapes", rate(flags, seconds=1.0), note=note)
    yield Measure("surface, union", "shapes", rate(lambda: len(union_mesh(solids).faces) and 1, seconds=1.0), note=note)
    ours = rate(lambda: len(signed_distances(solids, union, points)) // POINT_COUNT, seconds=1.0)
    name = f"surface, {POINT_COUNT} signed distances"
    yield Measure(name, "shapes", ours, "Open3D", rate(open3d_distances, seconds=1.0), note)
    yield Measure(name, "shapes", ours, "trimesh", rate(trimesh_distances, seconds=1.0), note)
    grids = rate(lambda: len(occupancy_grid(solids, cube, CELL_COUNT)) and 1, seconds=1.0)
    yield Measure(f"surface, occupancy of {CELL_COUNT}³ cells", "shapes", grids, note=note)
    texts = rate(lambda: len(captions(facts, "cabinet", ("short", "medium", "long"), _rng())) and 1, seconds=1.0)
    yield Measure("captions, three lengths", "shapes", texts, note=note)


def _rng() -> np.random.Generator:
    return np.random.default_rng(0)
