"""The contact test: do two posed parts touch, and in a point, along a line or over a face?

Two parts are in contact if their triangle meshes intersect or come within the contact tolerance of each other (strings
§3, with a tolerance for meshes that meet face to face). Exemplars, variations and eval all use this test.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.pose import relative_poses, transform_points
from stages.shape.kit import ContactKind, PartMesh

POINT_SHARE = 0.05
"""A contact shorter than this share of the smaller part's diagonal is a point."""
LINE_SHARE = 0.01
"""A contact narrower than this share of the smaller part's diagonal is a line."""
LINE_TOLERANCES = 4.0
"""A contact narrower than this many tolerances is a line, however small the parts are."""
PAIRS_LOOKED_AT = tuple(2**power for power in range(12, 21, 2))
"""Pairs of near triangles that are looked at before all: of dense meshes within each other there are millions."""
ROUNDING_MARGIN = 1.0001
"""Factor by which a bound is exceeded where rounding must not decide."""

Mesh = tuple[FloatArray, FloatArray, np.ndarray]


class ContactTest:
    """Contact of posed parts of given types.

    types: meshes of the types
    tolerance: largest distance in contact, in the units of the parts
    """

    def __init__(self, types: Sequence[PartMesh], tolerance: float) -> None:
        self.types = tuple(types)
        self.tolerance = tolerance

    @cached_property
    def diagonals(self) -> FloatArray:
        """Diagonal of each type, float64 (types,)."""
        return np.array([kind.diagonal for kind in self.types])

    def touches(self, a: int, b: int, pose: FloatArray, tolerance: float | None = None) -> bool:
        """Return whether a part of type `b` at `pose` (4, 4) in coordinates of a part of type `a` touches that part."""
        from stages.shape.geometry.mesh_pairs import first_contact

        return first_contact(
            self.types[a].box_tree, self.types[b].box_tree, pose, self.tolerance if tolerance is None else tolerance
        )

    def area(self, a: int, b: int, pose: FloatArray) -> FloatArray:
        """Return points (q, 3) that span the touching area, in coordinates of the part of type `a`; empty without
        contact.
        """
        points: FloatArray = self._patches(a, b, pose)[0]
        return points

    def _patches(
        self, a: int, b: int, pose: FloatArray, most: int | None = None
    ) -> tuple[FloatArray, FloatArray, np.ndarray]:
        """Return points, areas and crossings of `contact_patches`, all empty without contact.

        most: maximum number of pairs of triangles, the first ones; None: all
        """
        from stages.shape.geometry.mesh_pairs import contact_patches, first_pairs, near_pairs

        trees = self.types[a].box_tree, self.types[b].box_tree
        if most is None:
            pairs = near_pairs(*trees, pose, self.tolerance)
        else:
            pairs = first_pairs(*trees, pose, self.tolerance, most)
        patches: tuple[FloatArray, FloatArray, np.ndarray] = contact_patches(
            self.types[a].box_tree[0], self.types[b].box_tree[0], pairs, pose, self.tolerance
        )
        return patches

    def kind(self, a: int, b: int, pose: FloatArray) -> ContactKind | None:
        """Return the kind of the contact by the extent of the touching area, or None without contact.

        The touching area is the union, over all pairs of triangles within tolerance, of the share of one triangle that
        lies near the other. Its extents along its principal axes decide, so the pose of the parts in the world does not
        matter.
        """
        smaller = min(self.diagonals[a], self.diagonals[b])
        narrow = max(LINE_SHARE * smaller, LINE_TOLERANCES * self.tolerance)
        for most in (*PAIRS_LOOKED_AT, None):
            points, areas, crossing = self._patches(a, b, pose, most)
            if len(crossing) != most:
                break
            longest = smaller + 2 * self.tolerance
            has_area = crossing.any() or areas.sum() > ROUNDING_MARGIN * LINE_TOLERANCES * self.tolerance * longest
            if has_area and is_surely_wide(points, POINT_SHARE * smaller, narrow):
                return "face"
        if len(crossing) == 0:
            return None
        if len(points) < 3:
            return "point"
        centred = points - points.mean(axis=0)
        _, axes = np.linalg.eigh(centred.T @ centred)
        length, width, _ = np.sort(np.ptp(centred @ axes, axis=0))[::-1]
        if length < POINT_SHARE * smaller:
            return "point"
        if width < narrow:
            return "line"
        # Two or more lines side by side are wide too: a face has area of its own, or the parts pass into each other.
        if not crossing.any() and areas.sum() / length < LINE_TOLERANCES * self.tolerance:
            return "line"
        return "face"

    def contacts(self, types: np.ndarray, poses: FloatArray) -> IntArray:
        """Return the contacts of an assembly, int32 (m, 2), i < j, in lexicographic order."""
        boxes = world_boxes(self.types, types, poses)
        pairs = overlapping_boxes(boxes, self.tolerance)
        moved = relative_poses(poses, pairs)
        touching = [
            self.touches(int(types[i]), int(types[j]), pose) for (i, j), pose in zip(pairs.tolist(), moved, strict=True)
        ]
        return pairs[np.array(touching, dtype=bool)] if len(pairs) else pairs


def is_surely_wide(points: FloatArray, length: float, width: float) -> bool:
    """Return whether all points that include some (q, 3) have at least a length and a width along any axes.

    A triangle of these points is looked at. Along three axes at right angles, the largest extent is at least its
    longest side by the root of 3. Were the second largest below `width`, the points would be in a prism that is as wide
    in both directions, and the triangle would be no higher than the prism's diagonal.
    """
    if len(points) < 3:
        return False
    first = points[0]
    second = points[int(np.linalg.norm(points - first, axis=1).argmax())]
    heights = np.linalg.norm(np.cross(points - first, second - first), axis=1)
    third = points[int(heights.argmax())]
    longest = max(
        float(np.linalg.norm(one - other)) for one, other in ((first, second), (first, third), (second, third))
    )
    height = float(heights.max()) / max(longest, 1e-300)
    is_long = longest >= ROUNDING_MARGIN * math.sqrt(3.0) * length
    return is_long and height >= ROUNDING_MARGIN * math.sqrt(2.0) * width


def world_boxes(part_types: Sequence[PartMesh], types: np.ndarray, poses: FloatArray) -> FloatArray:
    """Return the tight axis-aligned boxes of posed parts, float64 (n, 2, 3)."""
    boxes = np.empty((len(types), 2, 3))
    for index, (part_type, pose) in enumerate(zip(types, poses, strict=True)):
        columns = np.ascontiguousarray(transform_points(pose, part_types[part_type].vertices).T)  # 20 times as fast
        boxes[index] = columns.min(axis=1), columns.max(axis=1)
    return boxes


def overlapping_boxes(boxes: FloatArray, tolerance: float) -> IntArray:
    """Return pairs i < j of boxes (n, 2, 3) at most `tolerance` apart in every axis, int32 (m, 2), in lexicographic
    order.
    """
    order = np.argsort(boxes[:, 0, 0], kind="stable")
    low, high = boxes[order, 0], boxes[order, 1] + tolerance
    ends = np.searchsorted(low[:, 0], high[:, 0], side="right")
    counts = np.maximum(ends - np.arange(len(order)) - 1, 0)
    first = np.repeat(np.arange(len(order)), counts)
    second = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts) + first + 1
    hit = np.all((low[second, 1:] <= high[first, 1:]) & (low[first, 1:] <= high[second, 1:]), axis=1)
    pairs = np.sort(np.stack([order[first[hit]], order[second[hit]]], axis=1), axis=1)
    return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))].astype(np.int32)
