"""Whether cuboids stand where they are attached: one that is aligned, or attached more than twice, cannot always."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from stages.shapeassembly.interpreter import parts_of
from stages.shapeassembly.program import BBOX, FACES, Attach, Block, Point, Squeeze

__all__ = ["APART", "both_ends", "coming_apart"]

APART = 0.05
"""How far the two points of an attachment may be from each other in the end, as a share of the diagonal of the bounding
box, as an attachment to it may be from its top or bottom; in 2.5 % of real chairs they are further apart."""


def coming_apart(block: Block) -> list[str]:
    """The cuboids of one assembly that in the end are further than APART from a point that they were attached to, by
    name, in the order of the lines; copies are as their originals. Raises ProgramError where the assembly by itself
    cannot be executed."""
    boxes = dict(zip(*parts_of(block), strict=True))
    boxes[BBOX] = np.array([0.0, 0.0, 0.0, *block.bbox.dims, *np.eye(3).ravel()])
    found: dict[str, None] = {}
    for line in block.lines:
        for each in (line,) if isinstance(line, Attach) else both_ends(line) if isinstance(line, Squeeze) else ():
            ends = [
                box[:3] + ((np.array(point) - 0.5) * box[3:6]) @ box[6:].reshape(3, 3)
                for box, point in ((boxes[each.moved], each.source), (boxes[each.target], each.goal))
            ]
            if np.linalg.norm(ends[0] - ends[1]) > APART * np.linalg.norm(block.bbox.dims):
                found[each.moved] = None
    return list(found)


def both_ends(line: Squeeze) -> Iterator[Attach]:
    """The two attachments that a squeeze is: an opposite face of a cuboid, the same face of the bounding box."""
    face = FACES.index(line.face)
    for own, target in ((face, line.first), (face ^ 1, line.second)):
        there = own if target == BBOX else own ^ 1
        yield Attach(line.moved, target, _on_face(own, 0.5, 0.5), _on_face(there, line.u, line.v))


def _on_face(face: int, u: float, v: float) -> Point:
    place = [u, v]
    place.insert(face // 2, 1.0 - face % 2)
    return (place[0], place[1], place[2])
