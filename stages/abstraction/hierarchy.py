"""A shape as a part hierarchy: the minimum box of each part, with near parts grouped into small assemblies."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.kit import PartMesh
from stages.shape.shape import Shape
from stages.shapeassembly.extraction.boxes import bounding_box, box_gap, corners_of_box
from stages.shapeassembly.extraction.hierarchy import Box, PartHierarchy, PartNode, check_limits
from stages.shapeassembly.extraction.readers.minimum_box import minimum_box

TOUCHING_GAP_SHARE = 0.01
"""Gap up to which boxes count as touching, as a share of the shape's diagonal."""

MAX_TURNED_VOLUME_SHARE = 0.5
"""Share of the volume below which a turned box replaces the box along the part's own axes.

Leaning posts are far below it; roofs and bent armrests, which look no better in a turned box, are above."""


class Boxes:
    """Caches the minimum box of each mesh."""

    def __init__(self) -> None:
        self._known: dict[PartMesh, Box] = {}

    def of(self, mesh: PartMesh, pose: FloatArray) -> Box:
        """Return the box of a part of this mesh at a rigid pose (4, 4)."""
        if mesh not in self._known:
            self._known[mesh] = minimum_box(mesh.vertices, MAX_TURNED_VOLUME_SHARE)
        box = self._known[mesh]
        return Box(pose[:3, :3] @ box.center + pose[:3, 3], box.size, box.axes @ pose[:3, :3].T)


def part_hierarchy(shape: Shape, children: int, boxes: Boxes) -> PartHierarchy:
    """Return the parts of an upright shape below nodes of at most `children` children.

    Nodes are connected groups of parts; a node with more disconnected pieces has more children. Raises Rejected for
    more parts than a hierarchy may have.
    """
    assembly = shape.assembly
    leaves = [
        PartNode(shape.meshes[kind].label, boxes.of(shape.meshes[kind], pose))
        for kind, pose in zip(assembly.types.tolist(), assembly.poses, strict=True)
    ]
    corners = np.stack([corners_of_box(leaf.box) for leaf in leaves])
    reach = TOUCHING_GAP_SHARE * float(np.linalg.norm(np.ptp(corners.reshape(-1, 3), axis=0)))
    label = max(leaves, key=lambda leaf: float(np.prod(leaf.box.size))).label
    check_limits(PartNode(label, leaves[0].box, tuple(leaves)), "a sample")
    return PartHierarchy("sample", _node(label, leaves, corners, children, reach))


def _node(label: str, leaves: Sequence[PartNode], corners: FloatArray, children: int, reach: float) -> PartNode:
    """Return the node of some leaves with corners (n, 8, 3)."""
    below = []
    for group in _grouped(leaves, corners, children, reach):
        within = [leaves[index] for index in group]
        if len(within) == 1:
            below.append(within[0])
        else:
            largest = max(within, key=lambda leaf: float(np.prod(leaf.box.size)))
            below.append(_node(f"{largest.label}_group", within, corners[group], children, reach))
    return PartNode(label, bounding_box(corners.reshape(-1, 3), np.eye(3)), tuple(below))


def _grouped(leaves: Sequence[PartNode], corners: FloatArray, max_groups: int, reach: float) -> list[list[int]]:
    """Group leaves with corners (n, 8, 3) into at most `max_groups`, or into their connected components.

    Repeatedly joins the two touching groups with the smallest common upright box.
    """
    groups = [[index] for index in range(len(corners))]
    low, high = corners.min(axis=1), corners.max(axis=1)
    # Over all pairs of groups: the volume of their common box, and infinite where they do not touch.
    touching = (np.maximum(low[:, None], low) <= np.minimum(high[:, None], high) + reach).all(axis=-1)
    for first, second in np.argwhere(np.triu(touching, 1)).tolist():
        near = box_gap(leaves[first].box, leaves[second].box)[0] <= reach
        touching[first, second] = touching[second, first] = near
    cost = np.where(touching, _common(low, high, low, high), np.inf)
    np.fill_diagonal(cost, np.inf)
    # A group of all would be the node again.
    while sum(map(bool, groups)) > max_groups:
        first, second = sorted(map(int, np.unravel_index(int(cost.argmin()), cost.shape)))
        if not np.isfinite(cost[first, second]):
            break
        groups[first], groups[second] = sorted(groups[first] + groups[second]), []
        low[first], high[first] = np.minimum(low[first], low[second]), np.maximum(high[first], high[second])
        touching[first] |= touching[second]
        touching[:, first] |= touching[:, second]
        cost[first] = np.where(
            touching[first], _common(low[first : first + 1], high[first : first + 1], low, high), np.inf
        )
        cost[first, [first, second]] = np.inf
        cost[second], cost[:, second] = np.inf, np.inf
        touching[second], touching[:, second] = False, False
        cost[:, first] = cost[first]
    return [group for group in groups if group]


def _common(low: FloatArray, high: FloatArray, others_low: FloatArray, others_high: FloatArray) -> FloatArray:
    """Return the volume (n, m) of the common box of each of n boxes and each of m others; flat boxes count as thin."""
    sizes = np.maximum(high[:, None], others_high) - np.minimum(low[:, None], others_low)
    volumes: FloatArray = np.prod(sizes + 1e-3 * float(np.abs(sizes).max()), axis=-1)
    return volumes
