"""One node of an arranged hierarchy: its parts in its frame, and their contacts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shapeassembly.extraction.boxes import angle_between, local_points
from stages.shapeassembly.extraction.contacts import Contact, bottom_or_top, contact_of
from stages.shapeassembly.extraction.hierarchy import Box, PartNode

BBOX_INDEX = -1
"""The bounding box among indices of parts."""

CONTACT_TOLERANCES = (0.02, 0.05)
"""Maximum gaps of parts in contact, as shares of the largest side of both: the first that connects every part is used.
The interpreter accepts the second as touching.
"""


@dataclass(frozen=True)
class NodeLayout:
    """The parts of a node.

    parts: in canonical order, with boxes in the node's frame, whose origin is the centre of `bbox`.
    contacts: by pairs i < j.
    bottoms, tops: the point where each part reaches the bottom and the top of the bounding box.
    anchors: for each part the only parts it may attach to, since its copies touch them too; None for all neighbours.
    """

    bbox: Box
    parts: tuple[PartNode, ...]
    contacts: dict[tuple[int, int], Contact]
    bottoms: tuple[FloatArray | None, ...]
    tops: tuple[FloatArray | None, ...]
    anchors: tuple[frozenset[int] | None, ...]

    @property
    def diagonal(self) -> float:
        """Diagonal of the bounding box."""
        return float(np.linalg.norm(self.bbox.size))

    def aligned(self, part: int) -> bool:
        """Return whether a part is parallel to the node's frame."""
        return angle_between(self.parts[part].box.axes, np.eye(3)) < 1e-3

    def neighbours(self, part: int) -> list[int]:
        """Return the parts that touch a part, ascending."""
        return sorted({i + j - part for i, j in self.contacts if part in (i, j)})

    def may_attach(self, mover: int, target: int) -> bool:
        """Return whether a part may be attached to a neighbour."""
        anchors = self.anchors[mover]
        return anchors is None or target in anchors

    def points(self, mover: int, target: int) -> tuple[FloatArray, FloatArray]:
        """Return the attachment points of a contact: (3,) on the mover and (3,) on the target."""
        contact = self.contacts[min(mover, target), max(mover, target)]
        return (contact.first, contact.second) if mover < target else (contact.second, contact.first)

    def at_face_center(self, mover: int, target: int) -> bool:
        """Return whether the attachment point of a contact is the centre of a face of the mover."""
        local = local_points(self.parts[mover].box, self.points(mover, target)[0])
        return bool((np.abs(local - 0.5) < 1e-3).sum() >= 2)

    def ungroundable(self) -> list[int]:
        """Return the parts that no chain of permitted attachments joins to the bounding box, ascending."""
        left = set(range(len(self.parts)))
        fresh = {i for i in left if self.bottoms[i] is not None or self.tops[i] is not None}
        while fresh:
            left -= fresh
            fresh = {i for i in left if any(j not in left and self.may_attach(i, j) for j in self.neighbours(i))}
        return sorted(left)


def layout_parts(parts: Sequence[PartNode], size: FloatArray) -> NodeLayout:
    """Return the layout of parts, in canonical order and in the node's frame, in a bounding box of `size` (3,)."""
    bbox = Box(np.zeros(3), size, np.eye(3))
    for reach in CONTACT_TOLERANCES:
        contacts = {}
        for j, second in enumerate(parts):
            for i, first in enumerate(parts[:j]):
                tolerance = reach * float(max(first.box.size.max(), second.box.size.max()))
                contact = contact_of(first.box, second.box, tolerance)
                if contact is not None:
                    contacts[i, j] = contact
        bottoms = tuple(bottom_or_top(part.box, bbox, top=False) for part in parts)
        tops = tuple(bottom_or_top(part.box, bbox, top=True) for part in parts)
        layout = NodeLayout(bbox, tuple(parts), contacts, bottoms, tops, (None,) * len(parts))
        if not layout.ungroundable():
            break
    return layout


def in_frame(part: PartNode, frame: Box) -> PartNode:
    """Return a part and all below it in the coordinates of a box, whose centre becomes the origin."""
    box = Box(frame.axes @ (part.box.center - frame.center), part.box.size, part.box.axes @ frame.axes.T)
    return PartNode(part.label, box, tuple(in_frame(child, frame) for child in part.children))
