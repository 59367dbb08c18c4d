"""An executed program as a shape: a box for each leaf cuboid, named by path, labelled by place in the hierarchy."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stages.shape.arrays import ByteArray
from stages.shape.kit import Assembly, PartMesh
from stages.shape.shape import Shape
from stages.shapeassembly.execution.interpreter import Execution, execute
from stages.shapeassembly.syntax.parser import parse

_FACES = np.array(
    [[0, 2, 3], [0, 3, 1], [4, 5, 7], [4, 7, 6], [0, 1, 5], [0, 5, 4],
     [2, 6, 7], [2, 7, 3], [0, 4, 6], [0, 6, 2], [1, 3, 7], [1, 7, 5]], dtype=np.int32,
)  # fmt: skip
"""Triangles of a box over corners in the order of `Execution.corners`, counter-clockwise from outside."""

_TONES = np.array(
    [[190, 140, 92], [126, 158, 171], [205, 178, 128], [136, 152, 106], [176, 112, 96], [150, 150, 156],
     [222, 204, 174], [104, 128, 150], [158, 118, 84], [172, 178, 150], [142, 110, 122]], np.uint8,
)  # fmt: skip
"""Colours of the labels in order, sRGB: woods, cloths and paints."""


def shape_of_program_text(text: str, labels: Sequence[str] = ()) -> Shape:
    """Return the shape of a program's text. Raises ProgramError where it cannot be read or executed."""
    return shape_of_execution(execute(parse(text)), labels)


def shape_of_execution(execution: Execution, labels: Sequence[str] = ()) -> Shape:
    """Return one centred mesh a leaf cuboid with its pose, y up; `own_names` are the paths.

    labels: those of all programs of a category, whose order decides the colours; without them the shape's own, sorted.
    """
    all_labels = tuple(labels) or tuple(sorted(set(execution.labels)))
    color_of = dict(zip(all_labels, category_label_colors(len(all_labels)), strict=True))
    halves = np.array([[x, y, z] for x in (0.5, -0.5) for y in (0.5, -0.5) for z in (0.5, -0.5)])
    meshes = tuple(
        PartMesh(label, halves * size, _FACES, np.tile(color_of[label], (len(_FACES), 1)))
        for size, label in zip(execution.sizes, execution.labels, strict=True)
    )
    poses = np.tile(np.eye(4), (len(meshes), 1, 1))
    poses[:, :3, :3] = execution.frames
    poses[:, :3, 3] = execution.centres
    assembly = Assembly(np.arange(len(meshes), dtype=np.int16), poses, np.empty((0, 2), np.int32))
    return Shape(meshes, assembly, "y", all_labels, execution.names)


def category_label_colors(count: int) -> ByteArray:
    """Return the colours of the first `count` labels of a category, sRGB uint8 (count, 3)."""
    return _TONES[np.arange(count) % len(_TONES)]
