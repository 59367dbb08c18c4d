"""Small bodies and random motions: what geometry is tried on."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray, IntArray
from stages.shape.kit import PartType

Body = tuple[FloatArray, IntArray]

CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
SIDES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))


def box(
    x: float = 1.0, y: float = 1.0, z: float = 1.0, at: tuple[float, float, float] = (0, 0, 0), sides: int = 6
) -> Body:
    """A box around `at`; with five `sides` it is open at the top of z."""
    faces = [face for a, b, c, d in SIDES[:sides] for face in ((a, b, c), (a, c, d))]
    return CORNERS * (x, y, z) + at, np.array(faces, dtype=np.int32)


def joined(*bodies: Body) -> Body:
    """Bodies as one mesh."""
    first = np.cumsum([0, *(len(vertices) for vertices, _ in bodies)])
    faces = [faces + shift for (_, faces), shift in zip(bodies, first, strict=False)]
    return np.concatenate([vertices for vertices, _ in bodies]), np.concatenate(faces).astype(np.int32)


def prism(sides: int, radius: float = 1.0, height: float = 3.0) -> Body:
    """An upright prism on a regular polygon, with both caps."""
    turn = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=1)
    rings = [np.column_stack([ring, np.full(sides, z)]) for z in (-height / 2, height / 2)]
    ends = np.array([[0, 0, -height / 2], [0, 0, height / 2]])
    faces: list[tuple[int, int, int]] = []
    for k in range(sides):
        n = (k + 1) % sides
        faces += [(k, n, sides + n), (k, sides + n, sides + k), (2 * sides, n, k)]
        faces += [(2 * sides + 1, sides + k, sides + n)]
    return np.concatenate([*rings, ends]), np.array(faces, dtype=np.int32)


def sphere(meridians: int = 16, parallels: int = 8, radius: float = 1.0) -> Body:
    """A ball by meridians and parallels, its axis along z."""
    rows = np.pi * np.arange(1, parallels) / parallels
    turn = 2 * np.pi * np.arange(meridians) / meridians
    rings = [
        np.stack([np.sin(a) * np.cos(turn), np.sin(a) * np.sin(turn), np.full(meridians, np.cos(a))], 1) for a in rows
    ]
    vertices = radius * np.concatenate([*rings, [[0, 0, 1], [0, 0, -1]]])
    top, bottom = len(vertices) - 2, len(vertices) - 1
    faces: list[tuple[int, int, int]] = []
    for k in range(meridians):
        n = (k + 1) % meridians
        faces += [(top, k, n), (bottom, (parallels - 2) * meridians + n, (parallels - 2) * meridians + k)]
        for row in range(parallels - 2):
            a, b = row * meridians, (row + 1) * meridians
            faces += [(a + k, b + k, b + n), (a + k, b + n, a + n)]
    return vertices, np.array(faces, dtype=np.int32)


def sheet(x: float = 1.0, y: float = 1.0) -> Body:
    """A rectangle in the plane z = 0, of two triangles."""
    return np.array([[-x, -y, 0], [x, -y, 0], [x, y, 0], [-x, y, 0]]) / 2, np.array([[0, 1, 2], [0, 2, 3]], np.int32)


def hull(rng: np.random.Generator, points: int = 12) -> Body:
    """The convex hull of random points."""
    from scipy.spatial import ConvexHull

    cloud = rng.normal(size=(points, 3))
    found = ConvexHull(cloud)
    used, faces = np.unique(found.simplices, return_inverse=True)
    return cloud[used], faces.reshape(-1, 3).astype(np.int32)


def part(body: Body, name: str = "part", symmetries: FloatArray | None = None) -> PartType:
    """A grey part type; without `symmetries` only the identity maps it onto itself."""
    vertices, faces = body
    group = np.eye(4)[None] if symmetries is None else symmetries
    return PartType(name, vertices.astype(float), faces, np.full((len(faces), 3), 160, np.uint8), np.eye(4), group)


def placed(x: float = 0.0, y: float = 0.0, z: float = 0.0, rotation: FloatArray | None = None) -> FloatArray:
    """A pose (4, 4)."""
    pose = np.eye(4)
    pose[:3, :3] = np.eye(3) if rotation is None else rotation
    pose[:3, 3] = x, y, z
    return pose


def random_rotation(rng: np.random.Generator) -> FloatArray:
    """A uniformly random rotation (3, 3)."""
    from scipy.spatial.transform import Rotation

    matrix: FloatArray = Rotation.random(random_state=rng).as_matrix()
    return matrix


def fcl_gap(one: Body, other: Body, pose: FloatArray) -> float:
    """The distance between one body and the other at `pose`, by FCL; 0 where their surfaces meet."""
    import fcl

    placed_bodies = []
    for (vertices, faces), at in ((one, np.eye(4)), (other, pose)):
        model = fcl.BVHModel()
        model.beginModel(len(vertices), len(faces))
        model.addSubModel(vertices, faces)
        model.endModel()
        placed_bodies.append(fcl.CollisionObject(model, fcl.Transform(at[:3, :3], at[:3, 3])))
    if fcl.collide(*placed_bodies, fcl.CollisionRequest(), fcl.CollisionResult()):
        return 0.0
    return float(fcl.distance(*placed_bodies, fcl.DistanceRequest(), fcl.DistanceResult()))
