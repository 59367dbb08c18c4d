"""Small part hierarchies whose programs are known."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stages.shapeassembly.extraction.hierarchy import Box, PartHierarchy, PartNode

Three = tuple[float, float, float]


def box(center: Three, size: Three, axes: np.ndarray | None = None) -> Box:
    return Box(np.array(center), np.array(size), np.eye(3) if axes is None else axes)


def leaf(label: str, center: Three, size: Three, axes: np.ndarray | None = None) -> PartNode:
    return PartNode(label, box(center, size, axes))


def node(label: str, children: Sequence[PartNode]) -> PartNode:
    return PartNode(label, children[0].box, tuple(children))


def hierarchy(*children: PartNode) -> PartHierarchy:
    return PartHierarchy("shape", node("root", children))


def turned(axis: int, degrees: float) -> np.ndarray:
    """Axes of a box turned about a coordinate axis."""
    first, second = [i for i in range(3) if i != axis]
    cos, sin = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    axes = np.eye(3)
    axes[first, first] = axes[second, second] = cos
    axes[first, second], axes[second, first] = sin, -sin
    return axes


def table() -> PartHierarchy:
    """A top on four legs, all boxes, 1.6 wide, 0.8 high, 0.9 deep."""
    legs = [leaf("leg", (x, -0.05, z), (0.1, 0.7, 0.1)) for x in (-0.7, 0.7) for z in (-0.35, 0.35)]
    return hierarchy(leaf("top", (0.0, 0.35, 0.0), (1.6, 0.1, 0.9)), *legs)
