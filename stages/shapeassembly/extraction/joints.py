"""Attach and squeeze lines between the parts of a layout."""

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
"""The boxes of grounded parts in the program, by index; BBOX_INDEX for the bounding box."""

LEFT, BOTTOM, TOP, BACK = (0, 0), (1, 0), (1, 1), (2, 0)
"""Faces as axis and end; the opposite face is the other end."""

_NAMES: dict[tuple[int, int], Face] = {LEFT: "left", BOTTOM: "bot", TOP: "top", BACK: "back"}

FLUSH_TOLERANCE = 0.005
"""Maximum distance from a side of a point that a squeeze moves onto it, as a share of the bounding box's diagonal."""

SAME_PLACE_TOLERANCE = 0.02
"""Maximum difference of both points of a squeeze for a part that turns with them, as a share of a face."""


def part_name(part: int) -> str:
    """Return the name of a part in its lines."""
    return BBOX_NAME if part == BBOX_INDEX else f"cube{part}"


def attach_line(
    layout: NodeLayout, placed: PlacedBoxes, part: int, target: int, own: FloatArray, goal: FloatArray
) -> Attach:
    """Return the line that moves point `own` (3,) of a part onto point `goal` (3,) of a target, in the node's frame."""
    return Attach(
        part_name(part),
        part_name(target),
        _place(layout.parts[part].box, own),
        _place(placed[target], goal),
    )


def attach_contact(layout: NodeLayout, placed: PlacedBoxes, part: int, other: int) -> Attach:
    """Return the line that attaches a part to a placed neighbour at their contact."""
    own, goal = layout.points(part, other)
    return attach_line(layout, placed, part, other, own, goal)


def squeeze(
    layout: NodeLayout, placed: PlacedBoxes, part: int, targets: tuple[int, int], face: tuple[int, int]
) -> Squeeze | None:
    """Return the line that puts `face` of a part on the first target and its opposite face on the second (shapeassembly
    App. B).

    Returns None if the part is not so placed. A target that is not placed yet is taken from the layout. An aligned part
    is placed by the first target; from the second it may be as far away as the interpreter leaves it.
    """
    axis, end = face
    box = layout.parts[part].box
    flush = FLUSH_TOLERANCE * layout.diagonal
    local_places = []
    for target, side in zip(targets, (end, 1 - end), strict=True):
        center = np.full(3, 0.5)
        center[axis] = side
        point = world_points(box, center)
        target_box = placed[target] if target in placed else layout.parts[target].box
        local = local_points(target_box, point)
        wanted = side if target == BBOX_INDEX else 1 - side
        near = (
            CONTACT_TOLERANCES[-1] * max(*box.size, *target_box.size) if side != end and layout.aligned(part) else flush
        )
        if abs(local[axis] - wanted) * target_box.size[axis] > near:
            return None
        local_places.append(np.delete(local, axis))
    if min(map(np.min, local_places)) < -1e-3 or max(map(np.max, local_places)) > 1 + 1e-3:
        return None
    if np.abs(local_places[0] - local_places[1]).max() > SAME_PLACE_TOLERANCE and not layout.aligned(part):
        return None
    u, v = np.clip(local_places[0], 0.0, 1.0).tolist()
    return Squeeze(part_name(part), part_name(targets[0]), part_name(targets[1]), _NAMES[face], u, v)


def _place(box: Box, point: FloatArray) -> Point:
    x, y, z = np.clip(local_points(box, point), 0.0, 1.0).tolist()
    return (x, y, z)
