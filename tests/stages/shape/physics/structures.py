"""Structures whose statics are known in closed form, as shapes with z up."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.kit import Assembly, PartMesh
from stages.shape.physics.judge import Judge, Validity
from stages.shape.physics.settings import PhysicsConfig
from stages.shape.shape import Shape
from tests.stages.shape.geometry.bodies import SIDES, Body, box

DRY = PhysicsConfig(joints="dry", connected=1e-5, touching=1e-6, push=0.0)
"""Masonry in exact coordinates, under gravity alone."""


def solid(*bodies: Body) -> Shape:
    """A shape of bodies in their places."""
    meshes = tuple(
        PartMesh("block", vertices.astype(float), faces, np.zeros((len(faces), 3), np.uint8))
        for vertices, faces in bodies
    )
    poses = np.tile(np.eye(4), (len(bodies), 1, 1))
    types = np.arange(len(bodies), dtype=np.int16)
    return Shape(meshes, Assembly(types, poses, np.empty((0, 2), np.int32)), "z", ("block",))


def judged(shape: Shape, config: PhysicsConfig = DRY, **changes: object) -> Validity:
    """The validity of a shape by a config with some keys changed."""
    changed = PhysicsConfig(**{**config.model_dump(), **changes})
    return Judge(shape.meshes, shape.up, changed).validity(shape.assembly)


def studded(body: Body) -> Body:
    """The same box with a vertex in the middle of each side: no longer eight vertices, so a mesh like any other."""
    vertices, _ = body
    middles = np.array([vertices[list(side)].mean(axis=0) for side in SIDES])
    faces = [(side[k], side[(k + 1) % 4], 8 + index) for index, side in enumerate(SIDES) for k in range(4)]
    return np.concatenate([vertices, middles]), np.array(faces, dtype=np.int32)


def standing_on(heights: Sequence[float], sizes: FloatArray, offsets: FloatArray) -> list[Body]:
    """Boxes one upon the other: sizes (n, 2) and offsets (n, 2) in plan."""
    floors = np.concatenate([[0.0], np.cumsum(heights)])
    return [
        box(sizes[k, 0], sizes[k, 1], heights[k], at=(offsets[k, 0], offsets[k, 1], floors[k] + heights[k] / 2))
        for k in range(len(heights))
    ]


def tower(count: int, share: float) -> list[Body]:
    """Unit blocks, each overhanging the one below by `share` of the harmonic limit 1 / (2 k), k from the top."""
    steps = [share / (2 * k) for k in range(count - 1, 0, -1)]
    offsets = np.stack([np.concatenate([[0.0], np.cumsum(steps)]), np.zeros(count)], axis=1)
    return standing_on([0.3] * count, np.ones((count, 2)), offsets)


def arch(blocks: int, thickness: float, radius: float = 1.0, depth: float = 0.3) -> list[Body]:
    """The voussoirs of a semicircular arch of mean `radius`, springing from the ground."""
    faces = box()[1]
    bodies = []
    for k in range(blocks):
        corners = [
            (r * np.cos(angle), y, r * np.sin(angle))
            for angle in (np.pi * k / blocks, np.pi * (k + 1) / blocks)
            for y in (-depth / 2, depth / 2)
            for r in (radius - thickness / 2, radius + thickness / 2)
        ]
        # Corners as those of a box in x, y, z: along the arch, across it, outwards; turned so that faces look out.
        bodies.append((np.array(corners), faces[:, ::-1].copy()))
    return bodies


def turned(shape: Shape, angle: float, scale: float, shift: tuple[float, float, float]) -> Shape:
    """The shape turned about the vertical, scaled and moved, its vertices themselves."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    return solid(*((scale * mesh.vertices @ turn.T + np.array(shift), mesh.faces) for mesh in shape.meshes))
