"""Deformed embedding: a piece that no rigid transform fits is deformed, part by part (substructures §5.2, §5.3).

Every cut edge has an upright frame in either shape; what moves one frame onto the other moves the parts near it. Each
part moves rigidly and keeps its mesh; contacts are tested afterwards. Frames are rough: where one mesh is at both sides
of a cut, the transform is the one by which it looks as there, nearest to the frames'. A part at the boundary follows
only its own cut edges, since a share of the others, however small, would break its contact.
"""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.contact import world_boxes
from stages.shape.geometry.pose import pose_vectors
from stages.shape.kit import Kit
from stages.variations.substructures.embedding import Side, transforms_onto

MAX_TURN_RADIANS = np.radians(45.0)
"""Largest difference of the angles between two consecutive cut edges, and between one and the vertical."""
MIN_LEVEL_SHARE = 0.1
"""Share of a cut edge's length that must be horizontal for the edge to tell how a piece is turned."""


def deform(kit: Kit, base: Side, giver: Side, boundary: np.ndarray, piece: np.ndarray) -> FloatArray:
    """Return the transforms float64 (k, 4, 4) of the k parts of a piece, in their order.

    The transform of a part is the mean of those of the boundary, weighted by the inverse of the distance from its
    centre to the origins of their frames.
    boundary: int64 (b, 2), darts as in `Operations`; at least one row has no dummy edge
    piece: bool (m,), parts of the giver that come
    """
    rows = boundary[(boundary >= 0).all(axis=1)]
    origins, moves = boundary_moves(kit, base, giver, rows)
    centres = world_boxes(kit.types, giver.assembly.types[piece], giver.assembly.poses[piece]).mean(axis=1)
    gaps = np.linalg.norm(centres[:, None] - origins, axis=2)
    weights = 1.0 / np.maximum(gaps, kit.pose_tolerance)
    is_own = np.flatnonzero(piece)[:, None] == giver.graph.tails[giver.graph.twins[rows[:, 1]]]
    weights = np.where(is_own.any(axis=1, keepdims=True), is_own, weights)
    weights /= weights.sum(axis=1, keepdims=True)
    u, _, vt = np.linalg.svd(np.einsum("kb,bij->kij", weights, moves[:, :3, :3]))
    u[:, :, 2] *= np.sign(np.linalg.det(u @ vt))[:, None]
    aims = np.einsum("bij,kj->kbi", moves[:, :3, :3], centres) + moves[:, :3, 3]
    transforms = np.tile(np.eye(4), (len(weights), 1, 1))
    transforms[:, :3, :3] = u @ vt
    transforms[:, :3, 3] = np.einsum("kb,kbi->ki", weights, aims) - np.einsum("kij,kj->ki", u @ vt, centres)
    return transforms


def is_oriented_alike(kit: Kit, base: Side, giver: Side, boundary: np.ndarray) -> bool:
    """Return whether consecutive cut edges have the same angles to each other, and to the vertical, in both shapes
    (§5.3).

    Only their direction from the part outside to the cut counts: that part is alike in both shapes, while the one
        inside may be a knob or a beam.
    """
    rows = boundary[(boundary >= 0).all(axis=1)]
    (own, _, _), (sites, _, _) = _cut_edges(kit, base, rows[:, 0]), _cut_edges(kit, giver, rows[:, 1])
    vertical = np.broadcast_to(np.eye(3)[{"y": 1, "z": 2}[kit.up]], sites.shape)
    for others, own_others in ((np.roll(sites, 1, axis=0), np.roll(own, 1, axis=0)), (vertical, vertical)):
        if (np.abs(_angles(sites, others) - _angles(own, own_others)) > MAX_TURN_RADIANS).any():
            return False
    return True


def boundary_moves(kit: Kit, base: Side, giver: Side, rows: np.ndarray) -> tuple[FloatArray, FloatArray]:
    """Return the origins of the giver's frames, float64 (b, 3), and what moves them onto the base's, (b, 4, 4)."""
    (_, aims, own), (_, origins, edges) = (
        _cut_edges(kit, side, rows[:, column]) for column, side in enumerate((base, giver))
    )
    moves = np.tile(np.eye(4), (len(rows), 1, 1))
    moves[:, :3, :3] = _turns(edges, own, {"y": 1, "z": 2}[kit.up])
    moves[:, :3, 3] = aims - np.einsum("bij,bj->bi", moves[:, :3, :3], origins)
    for row, (dart, image) in enumerate(rows.tolist()):
        candidates = transforms_onto(kit, giver, base, (image, dart), np.eye(4))
        inner = giver.graph.tails[giver.graph.twins[image]]
        pose, reach = giver.assembly.poses[inner], kit.types[giver.assembly.types[inner]].diagonal / 2
        if len(candidates):
            aim = pose_vectors((moves[row] @ pose)[None], reach)
            moves[row] = candidates[np.linalg.norm(pose_vectors(candidates @ pose, reach) - aim, axis=1).argmin()]
    return origins, moves


def _cut_edges(kit: Kit, side: Side, darts: np.ndarray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return three vectors (b, 3) of each dart: from the centre of the part outside to the cut, the cut, and inwards.

    The cut is the centre of what the boxes of both parts have in common.
    """
    boxes = world_boxes(kit.types, side.assembly.types, side.assembly.poses)
    outer, inner = boxes[side.graph.tails[darts]], boxes[side.graph.tails[side.graph.twins[darts]]]
    common = (np.maximum(outer[:, 0], inner[:, 0]) + np.minimum(outer[:, 1], inner[:, 1])) / 2
    return common - outer.mean(axis=1), common, inner.mean(axis=1) - common


def _angles(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the angles between directions (b, 3), float64 (b,), in radians."""
    lengths = np.maximum(np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1), 1e-12)
    angles: FloatArray = np.arccos(np.clip((a * b).sum(axis=1) / lengths, -1.0, 1.0))
    return angles


def _turns(edges: FloatArray, own: FloatArray, up: int) -> FloatArray:
    """Return how each cut edge (b, 3) is turned about the vertical to that of the other shape, float64 (b, 3, 3).

    Vertical edges are not turned.
    """
    first, second = (up + 1) % 3, (up + 2) % 3
    x, y = edges[:, [first, second]].T
    u, v = own[:, [first, second]].T
    norms = np.hypot(x, y) * np.hypot(u, v)
    is_level = norms > MIN_LEVEL_SHARE**2 * np.linalg.norm(edges, axis=1) * np.linalg.norm(own, axis=1)
    scale = 1.0 / np.where(is_level, norms, 1.0)
    cosines, sines = np.where(is_level, (x * u + y * v) * scale, 1.0), np.where(is_level, (x * v - y * u) * scale, 0.0)
    turns = np.tile(np.eye(3), (len(edges), 1, 1))
    turns[:, first, first] = turns[:, second, second] = cosines
    turns[:, second, first], turns[:, first, second] = sines, -sines
    return turns
