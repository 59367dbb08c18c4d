"""Compare where cuboids are with where they are attached.

An aligned cuboid, or one with more than two attachments, cannot always satisfy all of them (shapeassembly App. A).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shapeassembly.execution.interpreter import execute_block
from stages.shapeassembly.syntax.program import BBOX, FACES, Attach, Block, Cuboid, Point, Squeeze


def attachment_points(block: Block, name: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the attachments of a cuboid in the order of the lines, float64 (n, 3) each.

    Returns its own local points, their positions in the assembly, and the points of others that they should coincide
    with. Raises ProgramError where the assembly cannot be executed by itself.
    """
    boxes = dict(zip(*execute_block(block), strict=True))
    boxes[BBOX] = upright_row(block.bbox)
    joints = [
        joint
        for line in block.lines
        for joint in (
            (line,) if isinstance(line, Attach) else squeeze_attachments(line) if isinstance(line, Squeeze) else ()
        )
        if joint.moved == name
    ]
    local_points = np.array([joint.source for joint in joints]).reshape(-1, 3)
    actual = np.array([box_point(boxes[name], joint.source) for joint in joints]).reshape(-1, 3)
    wanted = np.array([box_point(boxes[joint.target], joint.goal) for joint in joints]).reshape(-1, 3)
    return local_points, actual, wanted


def squeeze_attachments(line: Squeeze) -> Iterator[Attach]:
    """Yield the two attachments of a squeeze: opposite faces of two cuboids, equal faces with the bounding box."""
    face = FACES.index(line.face)
    for own, target in ((face, line.first), (face ^ 1, line.second)):
        target_face = own if target == BBOX else own ^ 1
        yield Attach(line.moved, target, _on_face(own, 0.5, 0.5), _on_face(target_face, line.u, line.v))


def _on_face(face: int, u: float, v: float) -> Point:
    point = [u, v]
    point.insert(face // 2, 1.0 - face % 2)
    return (point[0], point[1], point[2])


def box_point(box: FloatArray, local: Point) -> FloatArray:
    """Return the point of a cuboid, a row of 15 numbers as in `execute_block`, with local coordinates."""
    return box[:3] + ((np.array(local) - 0.5) * box[3:6]) @ box[6:].reshape(3, 3)


def upright_row(cuboid: Cuboid) -> FloatArray:
    """Return an upright cuboid at the origin as a row of 15 numbers."""
    return np.array([0.0, 0.0, 0.0, *cuboid.dims, *np.eye(3).ravel()])
