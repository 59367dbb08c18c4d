"""Part hierarchies: trees of named parts with oriented boxes, whatever file they come from."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pipeline.errors import Rejected
from stages.shape.arrays import FloatArray

UNREADABLE = "unreadable hierarchy"
"""The reason with which readers reject a file."""

MAX_HIERARCHY_PARTS = 2000
"""Nodes of a hierarchy; the largest of PartNet has some hundreds."""

MAX_HIERARCHY_DEPTH = 32
"""Levels of a hierarchy; the deepest of PartNet has nine."""


@dataclass(frozen=True)
class Box:
    """An oriented box.

    center: float64 (3,).
    size: float64 (3,), full lengths.
    axes: float64 (3, 3), unit rows right, top and front, right-handed.
    """

    center: FloatArray
    size: FloatArray
    axes: FloatArray


@dataclass(frozen=True)
class PartNode:
    """A node: its semantic label, its box, and its parts (none for a leaf)."""

    label: str
    box: Box
    children: tuple[PartNode, ...] = ()

    def leaves(self) -> Iterator[PartNode]:
        """Yield the leaves below this node in order, or the node itself."""
        if not self.children:
            yield self
        for child in self.children:
            yield from child.leaves()


@dataclass(frozen=True)
class PartHierarchy:
    """A shape as a part hierarchy, y up, with the name from its file."""

    name: str
    root: PartNode


def check_limits(root: PartNode, source: str) -> PartNode:
    """Return the root. Raises Rejected if it has too many parts or levels."""
    level, depth, count = [root], 0, 0
    while level:
        depth, count = depth + 1, count + len(level)
        if depth > MAX_HIERARCHY_DEPTH or count > MAX_HIERARCHY_PARTS:
            raise Rejected(
                UNREADABLE,
                f"{source}: over {MAX_HIERARCHY_PARTS} parts or {MAX_HIERARCHY_DEPTH} levels; split or simplify it",
            )
        level = [child for part in level for child in part.children]
    return root


def box_from_numbers(numbers: FloatArray, location: str) -> Box:
    """Return a box from twelve numbers: centre, lengths, and the directions of the first two lengths.

    Axes are orthonormalised, since files give few digits. Raises Rejected, naming `location`, for numbers that are not
    finite, negative sizes and degenerate axes.
    """
    rows = numbers.reshape(4, 3)
    if not np.isfinite(rows).all() or np.abs(rows).max() > 1e9:
        raise Rejected(UNREADABLE, f"{location}: a box has twelve finite numbers: centre, size and two axes")
    if (rows[1] < 0).any():
        raise Rejected(UNREADABLE, f"{location}: a box has a negative size; write its lengths as positive numbers")
    right, top = rows[2], rows[3]
    lengths = np.linalg.norm(right), np.linalg.norm(top)
    if min(lengths) < 1e-6:
        raise Rejected(UNREADABLE, f"{location}: an axis of the box has no length; give two unit vectors")
    right, top = right / lengths[0], top / lengths[1]
    top = top - right * (right @ top)
    if np.linalg.norm(top) < 1e-2:
        raise Rejected(UNREADABLE, f"{location}: the axes of the box are parallel; give two perpendicular ones")
    top = top / np.linalg.norm(top)
    return Box(rows[0], rows[1], np.stack([right, top, np.cross(right, top)]))
