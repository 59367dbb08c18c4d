"""Where cuboids stand in the end, beside where they are attached: one that is aligned, or attached more than twice,
cannot always be where all of its attachments say (shapeassembly App. A)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shapeassembly.execution.interpreter import execute_block
from stages.shapeassembly.syntax.program import BBOX, FACES, Attach, Block, Point, Squeeze


def attachment_points(block: Block, name: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Where a cuboid of an assembly is attached, in the order of the lines: the points of its own, local coordinates,
    float64 (n, 3); where these lie in the assembly; and the points of others that they should lie at. Raises
    ProgramError where the assembly by itself cannot be executed."""
    boxes = dict(zip(*execute_block(block), strict=True))
    boxes[BBOX] = np.array([0.0, 0.0, 0.0, *block.bbox.dims, *np.eye(3).ravel()])
    joints = [
        joint
        for line in block.lines
        for joint in (
            (line,) if isinstance(line, Attach) else squeeze_attachments(line) if isinstance(line, Squeeze) else ()
        )
        if joint.moved == name
    ]
    own = np.array([joint.source for joint in joints]).reshape(-1, 3)
    stands = np.array([_point(boxes[name], joint.source) for joint in joints]).reshape(-1, 3)
    wanted = np.array([_point(boxes[joint.target], joint.goal) for joint in joints]).reshape(-1, 3)
    return own, stands, wanted


def squeeze_attachments(line: Squeeze) -> Iterator[Attach]:
    """The two attachments that a squeeze is: an opposite face of a cuboid, the same face of the bounding box."""
    face = FACES.index(line.face)
    for own, target in ((face, line.first), (face ^ 1, line.second)):
        there = own if target == BBOX else own ^ 1
        yield Attach(line.moved, target, _on_face(own, 0.5, 0.5), _on_face(there, line.u, line.v))


def _on_face(face: int, u: float, v: float) -> Point:
    place = [u, v]
    place.insert(face // 2, 1.0 - face % 2)
    return (place[0], place[1], place[2])


def _point(box: FloatArray, local: Point) -> FloatArray:
    """A point of a cuboid by its local coordinates; the cuboid as `execute_block` gives it, float64 (15,)."""
    return box[:3] + ((np.array(local) - 0.5) * box[3:6]) @ box[6:].reshape(3, 3)
