"""Attach and squeeze lines between the parts of a layout: places in boxes that stand, and what counts as a squeeze."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shapeassembly.extraction.boxes import local_points, world_points
from stages.shapeassembly.extraction.hierarchy import Box
from stages.shapeassembly.extraction.node_layout import BBOX_INDEX, CONTACT_TOLERANCES, NodeLayout
from stages.shapeassembly.syntax.program import BBOX as BBOX_NAME
from stages.shapeassembly.syntax.program import Attach, Face, Point, Squeeze

Joint = Attach | Squeeze

PlacedBoxes = Mapping[int, Box]
"""The boxes of grounded parts as the program puts them, by index; BBOX for the bounding box."""

LEFT, BOTTOM, TOP, BACK = (0, 0), (1, 0), (1, 1), (2, 0)
"""Faces as axis and end; the opposite face is the other end."""

_NAMES: dict[tuple[int, int], Face] = {LEFT: "left", BOTTOM: "bot", TOP: "top", BACK: "back"}

FLUSH_TOLERANCE = 0.005
"""How far from a side, as a share of the bounding box's diagonal, a point may be that a squeeze puts on it."""

SAME_PLACE_TOLERANCE = 0.02
"""How far apart, as shares of a face, the two places of a squeeze may be for a part that turns with them."""


def part_name(part: int) -> str:
    """What a part of a layout is called in its lines."""
    return BBOX_NAME if part == BBOX_INDEX else f"cube{part}"


def attach(
    layout: NodeLayout, standing: PlacedBoxes, part: int, target: int, own: FloatArray, goal: FloatArray
) -> Attach:
    """The line that brings point `own` (3,) of a part to point `goal` (3,) of what stands, in the node's frame."""
    return Attach(
        part_name(part),
        part_name(target),
        _place(layout.parts[part].box, own),
        _place(standing[target], goal),
    )


def attach_contact(layout: NodeLayout, standing: PlacedBoxes, part: int, other: int) -> Attach:
    """The line that attaches a part to a standing neighbour at the point of their contact."""
    own, goal = layout.points(part, other)
    return attach(layout, standing, part, other, own, goal)


def squeeze(
    layout: NodeLayout, standing: PlacedBoxes, part: int, targets: tuple[int, int], face: tuple[int, int]
) -> Squeeze | None:
    """The line that puts `face` of a part on the first target and its opposite face on the second; None if the part
    does not stand so (shapeassembly App. B).

    A target that does not stand yet is taken where the layout has it. An aligned part is placed by the first target;
    from the second it may stay as far away as the interpreter leaves it.
    """
    axis, end = face
    box = layout.parts[part].box
    flush = FLUSH_TOLERANCE * layout.diagonal
    places = []
    for target, side in zip(targets, (end, 1 - end), strict=True):
        center = np.full(3, 0.5)
        center[axis] = side
        point = world_points(box, center)
        target_box = standing[target] if target in standing else layout.parts[target].box
        place = local_points(target_box, point)
        wanted = side if target == BBOX_INDEX else 1 - side
        near = (
            CONTACT_TOLERANCES[-1] * max(*box.size, *target_box.size) if side != end and layout.aligned(part) else flush
        )
        if abs(place[axis] - wanted) * target_box.size[axis] > near:
            return None
        places.append(np.delete(place, axis))
    if min(map(np.min, places)) < -1e-3 or max(map(np.max, places)) > 1 + 1e-3:
        return None
    if np.abs(places[0] - places[1]).max() > SAME_PLACE_TOLERANCE and not layout.aligned(part):
        return None
    u, v = np.clip(places[0], 0.0, 1.0).tolist()
    return Squeeze(part_name(part), part_name(targets[0]), part_name(targets[1]), _NAMES[face], u, v)


def _place(box: Box, point: FloatArray) -> Point:
    x, y, z = np.clip(local_points(box, point), 0.0, 1.0).tolist()
    return (x, y, z)
