"""An executed program as a shape: one box a leaf cuboid, named by its path."""

from __future__ import annotations

import numpy as np

from stages.shape.kit import Assembly, PartMesh
from stages.shape.shape import Shape
from stages.shapeassembly.interpreter import Execution, execute
from stages.shapeassembly.parser import parse

__all__ = ["LABELS", "shape_of_execution", "shape_of_text"]

LABELS = ("cuboid",)
"""Programs say nothing about what their cuboids are: all have one label."""

_FACES = np.array(
    [[0, 2, 3], [0, 3, 1], [4, 5, 7], [4, 7, 6], [0, 1, 5], [0, 5, 4],
     [2, 6, 7], [2, 7, 3], [0, 4, 6], [0, 6, 2], [1, 3, 7], [1, 7, 5]], dtype=np.int32,
)  # fmt: skip
"""Triangles of a box over corners in the order of `Execution.corners`, seen from outside counter-clockwise."""

_COLORS = np.array(
    [[190, 140, 92], [126, 158, 171], [205, 178, 128], [136, 152, 106], [164, 114, 104], [150, 150, 156]], np.uint8
)
"""One colour after the other for the assemblies of a program, sRGB."""


def shape_of_text(text: str) -> Shape:
    """The shape of a program's text, y up. Raises ProgramError where it cannot be read or executed."""
    return shape_of_execution(execute(parse(text)))


def shape_of_execution(execution: Execution) -> Shape:
    """One mesh a leaf cuboid, centred, with its pose, `own_names` being the paths; cuboids of one assembly of
    the text share a colour."""
    halves = np.array([[x, y, z] for x in (0.5, -0.5) for y in (0.5, -0.5) for z in (0.5, -0.5)])
    meshes = tuple(
        PartMesh(LABELS[0], halves * size, _FACES, np.tile(_COLORS[block % len(_COLORS)], (len(_FACES), 1)))
        for size, block in zip(execution.sizes, execution.blocks.tolist(), strict=True)
    )
    poses = np.tile(np.eye(4), (len(meshes), 1, 1))
    poses[:, :3, :3] = execution.frames
    poses[:, :3, 3] = execution.centres
    assembly = Assembly(np.arange(len(meshes), dtype=np.int16), poses, np.empty((0, 2), np.int32))
    return Shape(meshes, assembly, "y", LABELS, execution.names)
