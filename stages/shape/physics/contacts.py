"""Which parts are connected, how deep they penetrate, and the patches on which they press."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from stages.shape.arrays import BoolArray, FloatArray, IntArray
from stages.shape.geometry.contact import overlapping_boxes
from stages.shape.geometry.pose import relative_poses
from stages.shape.kit import PartMesh
from stages.shape.physics.solids import MeshSolids, PlacedParts

POSE_STEP_SHARE = 1e-6
"""Grid of poses in cached queries, as a share of the smaller part's diagonal."""
MAX_CACHED_ANSWERS = 100_000


@dataclass(frozen=True)
class ContactPatches:
    """Points at which bodies press on each other.

    first, second: bodies of each point, int (q,); `second` is -1 for the ground
    patch: joint of each point, int (q,)
    points: float64 (q, 3)
    normals: unit, from the second body to the first, float64 (q, 3)
    """

    first: np.ndarray
    second: np.ndarray
    patch: np.ndarray
    points: FloatArray
    normals: FloatArray


class _Question(NamedTuple):
    """Two parts as one query sees them.

    a, b: their meshes
    pose: of the second in coordinates of the first, on a grid, float64 (4, 4)
    key: what equal questions have in common
    """

    a: int
    b: int
    pose: FloatArray
    key: tuple[int, int, bytes]


class PairContacts:
    """Queries about pairs of posed parts with given meshes. Recurring answers are cached."""

    def __init__(self, meshes: Sequence[PartMesh], solids: MeshSolids) -> None:
        self.meshes = tuple(meshes)
        self.solids = solids
        self._answers: dict[tuple[Any, ...], Any] = {}
        self._diagonals = np.array([mesh.diagonal for mesh in self.meshes])

    def connected(self, placed: PlacedParts, distance: float, known: IntArray) -> IntArray:
        """Return pairs of parts that overlap or are at most `distance` apart, int32 (m, 2), i < j in lexicographic
        order.

        known: pairs known to be connected

        A part that lies wholly inside another is connected to it.
        """
        from stages.shape.physics.boxes import boxes_within

        pairs = overlapping_boxes(placed.spans, distance)
        if not len(pairs):
            return pairs
        is_connected = _listed(pairs, known, len(placed))
        plain = _both_boxes(placed, pairs)
        unknown = plain & ~is_connected
        is_connected[unknown] = boxes_within(placed.centres, placed.axes, placed.halves, pairs[unknown], distance)
        unknown = ~plain & ~is_connected
        questions = zip(pairs[unknown].tolist(), self._questions(placed, pairs[unknown]), strict=True)
        is_connected[unknown] = [self._near(placed, i, j, question, distance) for (i, j), question in questions]
        return pairs[is_connected]

    def overlaps(self, placed: PlacedParts, pairs: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return the shared volume and the penetration depth of each pair, float64 (m,) each.

        Exact for two boxes, else measured on lines through the parts; 0 if a mesh is open.
        """
        from stages.shape.physics.boxes import overlap_volumes, separations

        volumes, depths = np.zeros(len(pairs)), np.zeros(len(pairs))
        plain = _both_boxes(placed, pairs)
        depths[plain] = np.maximum(-separations(placed.centres, placed.axes, placed.halves, pairs[plain]), 0.0)
        volumes[plain] = overlap_volumes(placed.centres, placed.axes, placed.halves, pairs[plain])
        closed = np.asarray(self.solids.closed)[placed.types[pairs]].all(axis=1)
        rows = np.flatnonzero(~plain & closed)
        for row, question in zip(rows.tolist(), self._questions(placed, pairs[rows]), strict=True):
            volumes[row], depths[row] = self._overlap(question)
        return volumes, depths

    def patches(self, placed: PlacedParts, pairs: IntArray, tolerance: float) -> tuple[ContactPatches, BoolArray]:
        """Return the patches between the parts of `pairs`, and which pairs are interlocked, bool (m,).

        Interlocked parts are near each other, but no face or edge of one lies on a face of the other.
        """
        from stages.shape.physics.boxes import box_contacts

        plain = np.flatnonzero(_both_boxes(placed, pairs))
        rows, points, normals = box_contacts(placed.centres, placed.axes, placed.halves, pairs[plain], tolerance)
        groups = [(plain[rows], points, normals)]
        locked = np.zeros(len(pairs), dtype=bool)
        others = np.setdiff1d(np.arange(len(pairs)), plain)
        for row, question in zip(others.tolist(), self._questions(placed, pairs[others]), strict=True):
            i = int(pairs[row, 0])
            near, points, normals = self._patch(question, tolerance)
            locked[row] = near and not len(points)
            rotation, offset = placed.poses[i, :3, :3], placed.poses[i, :3, 3]
            groups.append((np.full(len(points), row), points @ rotation.T + offset, -normals @ rotation.T))
        patch = np.concatenate([rows for rows, _, _ in groups])
        order = np.argsort(patch, kind="stable")
        patch = patch[order]
        return (
            ContactPatches(
                first=pairs[patch, 0].astype(np.int64),
                second=pairs[patch, 1].astype(np.int64),
                patch=patch,
                points=np.concatenate([points for _, points, _ in groups])[order],
                normals=np.concatenate([normals for _, _, normals in groups])[order],
            ),
            locked,
        )

    def _questions(self, placed: PlacedParts, pairs: IntArray) -> Iterator[_Question]:
        """Yield the question of each pair (m, 2)."""
        kinds = placed.types[pairs]
        poses = relative_poses(placed.poses, pairs)
        steps = POSE_STEP_SHARE * self._diagonals[kinds].min(axis=1)[:, None]
        poses[:, :3, 3] = np.round(poses[:, :3, 3] / steps) * steps + 0.0
        poses[:, :3, :3] = np.round(poses[:, :3, :3] / POSE_STEP_SHARE) * POSE_STEP_SHARE + 0.0
        for (a, b), pose in zip(kinds.tolist(), poses, strict=True):
            yield _Question(a, b, pose, (a, b, pose.tobytes()))

    def _remember(self, question: tuple[Any, ...], answer: Any) -> Any:
        if len(self._answers) >= MAX_CACHED_ANSWERS:
            self._answers.clear()
        self._answers[question] = answer
        return answer

    def _near(self, placed: PlacedParts, i: int, j: int, question: _Question, distance: float) -> bool:
        from stages.shape.geometry.mesh_pairs import first_contact

        asked = ("near", question.key, distance)
        if asked in self._answers:
            return bool(self._answers[asked])
        near = first_contact(
            self.meshes[question.a].box_tree, self.meshes[question.b].box_tree, question.pose, distance
        )
        if not near:
            inner = (placed.spans[i] - placed.spans[j]) * [[1], [-1]]
            near = bool((inner >= 0).all() or (inner <= 0).all()) and self._overlap(question)[0] > 0
        return bool(self._remember(asked, near))

    def _overlap(self, question: _Question) -> tuple[float, float]:
        from stages.shape.physics.patches import overlap

        a, b, pose, key = question
        if not (self.solids.closed[a] and self.solids.closed[b]):
            return 0.0, 0.0
        asked = ("overlap", key)
        if asked in self._answers:
            cached: tuple[float, float] = self._answers[asked]
            return cached
        moved = self.meshes[b].vertices @ pose[:3, :3].T + pose[:3, 3]
        low = np.maximum(self.meshes[a].bounds[0], moved.min(axis=0))
        high = np.minimum(self.meshes[a].bounds[1], moved.max(axis=0))
        answer = (0.0, 0.0)
        if (high > low).all():
            answer = overlap(self.meshes[a].box_tree[0], self.meshes[b].box_tree[0], pose, low, high)
        remembered: tuple[float, float] = self._remember(asked, answer)
        return remembered

    def _patch(self, question: _Question, tolerance: float) -> tuple[bool, FloatArray, FloatArray]:
        """Return whether the parts are within `tolerance`, the corners of the patches between them, and normals out of
        the first.

        All are in coordinates of the first.
        """
        from stages.shape.geometry.mesh_pairs import near_pairs
        from stages.shape.geometry.pose import invert
        from stages.shape.physics.patches import facing_polygons, flat_hulls, touching_edges

        a, b, pose, key = question
        asked = ("patch", key, tolerance)
        if asked in self._answers:
            cached: tuple[bool, FloatArray, FloatArray] = self._answers[asked]
            return cached
        pairs = near_pairs(self.meshes[a].box_tree, self.meshes[b].box_tree, pose, tolerance)
        corners_a, corners_b = self.meshes[a].box_tree[0], self.meshes[b].box_tree[0]
        closed = bool(self.solids.closed[a] and self.solids.closed[b])
        points, normals = facing_polygons(corners_a, corners_b, pairs, pose, tolerance, closed)
        if not closed:
            # An open surface has no outside: the normal leads from one part to the other.
            way = pose[:3, :3] @ self.solids.centroids[b] + pose[:3, 3] - self.solids.centroids[a]
            normals = normals * np.where(normals @ way < 0, -1.0, 1.0)[:, None]
        if not len(points) and len(pairs):
            points, normals = touching_edges(corners_a, corners_b, pairs, pose, tolerance)
            back = invert(pose)
            other, outward = touching_edges(corners_b, corners_a, pairs[:, ::-1].copy(), back, tolerance)
            points = np.concatenate([points, other @ pose[:3, :3].T + pose[:3, 3]])
            normals = np.concatenate([normals, -outward @ pose[:3, :3].T])
        answer = (len(pairs) > 0, *flat_hulls(points, normals, tolerance))
        remembered: tuple[bool, FloatArray, FloatArray] = self._remember(asked, answer)
        return remembered


def _both_boxes(placed: PlacedParts, pairs: IntArray) -> BoolArray:
    return placed.boxes[pairs[:, 0]] & placed.boxes[pairs[:, 1]]


def _listed(pairs: IntArray, known: IntArray, count: int) -> BoolArray:
    """Return which of `pairs` are among the pairs `known`, bool (m,)."""
    listed: BoolArray = np.isin(
        pairs[:, 0] * np.int64(count) + pairs[:, 1], known[:, 0] * np.int64(count) + known[:, 1]
    )
    return listed
