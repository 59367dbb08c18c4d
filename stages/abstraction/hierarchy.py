"""A shape as a part hierarchy: each part its smallest box, and near parts gathered until an assembly is small."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.kit import PartMesh
from stages.shape.shape import Shape
from stages.shapeassembly.extraction.boxes import bounding_box, box_corners, box_gap
from stages.shapeassembly.extraction.hierarchy import Box, PartHierarchy, PartNode, check_limits
from stages.shapeassembly.extraction.readers.minimum_box import minimum_box

SAME_SHARE = 0.01
"""Up to which boxes count as touching, as a share of the diagonal of the shape."""

MIN_TURN_GAIN = 0.5
"""A part stands along its own axes unless a turned box has less than this share of the volume: leaning posts are far
below it, roofs and bent armrests, which look no better in a turned box, above."""


class Boxes:
    """The smallest box around each mesh, found once for all parts and shapes that have it."""

    def __init__(self) -> None:
        self._known: dict[PartMesh, Box] = {}

    def of(self, mesh: PartMesh, pose: FloatArray) -> Box:
        """The box of a part of this mesh at a rigid pose (4, 4)."""
        if mesh not in self._known:
            self._known[mesh] = minimum_box(mesh.vertices, MIN_TURN_GAIN)
        box = self._known[mesh]
        return Box(pose[:3, :3] @ box.center + pose[:3, 3], box.size, box.axes @ pose[:3, :3].T)


def hierarchy_of(shape: Shape, children: int, boxes: Boxes) -> PartHierarchy:
    """The parts of an upright shape below nodes of at most `children` each.

    Nodes are groups of parts that hang together; where a group falls into more pieces than that, its node has more.
    Raises Rejected for more parts than a hierarchy may have.
    """
    assembly = shape.assembly
    leaves = [
        PartNode(shape.meshes[kind].label, boxes.of(shape.meshes[kind], pose))
        for kind, pose in zip(assembly.types.tolist(), assembly.poses, strict=True)
    ]
    corners = np.stack([box_corners(leaf.box) for leaf in leaves])
    reach = SAME_SHARE * float(np.linalg.norm(np.ptp(corners.reshape(-1, 3), axis=0)))
    label = max(leaves, key=lambda leaf: float(np.prod(leaf.box.size))).label
    check_limits(PartNode(label, leaves[0].box, tuple(leaves)), "a sample")
    return PartHierarchy("sample", _node(label, leaves, corners, children, reach))


def _node(label: str, leaves: Sequence[PartNode], corners: FloatArray, children: int, reach: float) -> PartNode:
    """The node of some leaves, whose corners are (n, 8, 3)."""
    below = []
    for group in _gathered(leaves, corners, children, reach):
        within = [leaves[index] for index in group]
        if len(within) == 1:
            below.append(within[0])
        else:
            largest = max(within, key=lambda leaf: float(np.prod(leaf.box.size)))
            below.append(_node(f"{largest.label}_group", within, corners[group], children, reach))
    return PartNode(label, bounding_box(corners.reshape(-1, 3), np.eye(3)), tuple(below))


def _gathered(leaves: Sequence[PartNode], corners: FloatArray, most: int, reach: float) -> list[list[int]]:
    """Leaves with corners (n, 8, 3) in at most `most` groups, or as many as they fall apart into: of two groups
    that touch, those are joined whose common upright box is least, again and again."""
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
    while sum(map(bool, groups)) > most:
        first, second = sorted(int(each) for each in np.unravel_index(int(cost.argmin()), cost.shape))
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
    """The volume of the box around each two boxes, (n, m), of n and m; flat ones count as thin."""
    sizes = np.maximum(high[:, None], others_high) - np.minimum(low[:, None], others_low)
    volumes: FloatArray = np.prod(sizes + 1e-3 * float(np.abs(sizes).max()), axis=-1)
    return volumes
