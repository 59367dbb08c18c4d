"""Affine embedding: a piece that no rigid transform fits is stretched as a whole (substructures §5.2, §5.3).

The paper interpolates the transforms of the boundary frames vertex by vertex. Contacts of real kits are exact, and such
a map keeps none of those within a piece. The nearest affine map keeps them all and adds none, so only the boundary must
be tested.
"""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import BoolArray, FloatArray
from stages.shape.geometry.contact import world_boxes
from stages.shape.kit import Kit
from stages.shape.stretch import STRETCHED_DEPTH
from stages.variations.substructures.deformation import boundary_moves
from stages.variations.substructures.embedding import Side

RELATIVE_STIFFNESS = 1e-6
"""Cost of turning away from the mean of the boundary's transforms, relative to the spread of the boundary: enough to
decide what the boundary leaves open.
"""
MAX_TILT = 1e-3
"""Entries of a linear map that tilt the vertical, or a floor, by less are 0."""


def stretch_onto(
    kit: Kit,
    base: Side,
    giver: Side,
    boundary: np.ndarray,
    piece: np.ndarray,
    max_factor: float,
    up: int,
    rigid: BoolArray,
) -> FloatArray | None:
    """Return the transforms float64 (k, 4, 4) of the k parts of a piece: one affine map, rigid for rigid parts, or
    None.

    The map brings the places where the piece touches what stays of the giver nearest to where the boundary's transforms
    move them. Rigid parts move rigidly as the map moves their centres. None where the map does not come near the
    boundary, stretches beyond `max_factor`, mirrors or tilts.
    boundary: int64 (b, 2), darts as in `Operations`
    piece: bool (m,), parts of the giver that come
    up: axis that stays upright, or -1
    rigid: bool (types,)
    """
    rows = boundary[(boundary >= 0).all(axis=1)]
    inner = giver.graph.tails[giver.graph.twins[rows[:, 1]]] if len(rows) else np.empty(0, dtype=np.int64)
    if not len(rows) or not piece[inner].all():
        return None
    _, moves = boundary_moves(kit, base, giver, rows)
    points = _touching(kit, giver, rows[:, 1])
    aims = np.einsum("bij,bpj->bpi", moves[:, :3, :3], points) + moves[:, None, :3, 3]
    affine = _affine(points.reshape(-1, 3), aims.reshape(-1, 3), moves[:, :3, :3].mean(axis=0))
    linear = affine[:3, :3]
    sizes = np.linalg.svd(linear, compute_uv=False)
    level = np.delete(np.arange(3), up) if up >= 0 else np.empty(0, dtype=np.int64)
    if sizes[0] > max_factor or sizes[-1] < 1 / max_factor or np.linalg.det(linear) < 0:
        return None
    if np.abs([*linear[up, level], *linear[level, up]]).max(initial=0.0) > MAX_TILT:
        return None
    gaps = np.linalg.norm(points @ linear.T + affine[:3, 3] - aims, axis=2).max(axis=1)
    reach = np.array([kit.types[part_type].diagonal for part_type in giver.assembly.types[inner]])
    if (gaps > np.maximum(kit.pose_tolerance, STRETCHED_DEPTH * reach)).any():
        return None
    transforms = np.tile(affine, (int(piece.sum()), 1, 1))
    stiff = rigid[giver.assembly.types[piece]]
    if stiff.any():
        centres = world_boxes(kit.types, giver.assembly.types[piece], giver.assembly.poses[piece]).mean(axis=1)
        u, _, vt = np.linalg.svd(linear)
        transforms[stiff, :3, :3] = u @ vt
        transforms[stiff, :3, 3] += centres[stiff] @ (linear - u @ vt).T
    return transforms


def _touching(kit: Kit, side: Side, darts: np.ndarray) -> FloatArray:
    """Return the corners of what the boxes of the parts at both ends of each dart have in common, float64 (b, 8, 3)."""
    boxes = world_boxes(kit.types, side.assembly.types, side.assembly.poses)
    outer, inner = boxes[side.graph.tails[darts]], boxes[side.graph.tails[side.graph.twins[darts]]]
    ends = np.stack([np.maximum(outer[:, 0], inner[:, 0]), np.minimum(outer[:, 1], inner[:, 1])], axis=1)
    corners = np.stack(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij"), axis=-1).reshape(8, 3)
    common_corners: FloatArray = ends[:, corners, np.arange(3)]
    return common_corners


def _affine(points: FloatArray, aims: FloatArray, like: FloatArray) -> FloatArray:
    """Return the affine map (4, 4) that brings points (p, 3) nearest to their aims (p, 3), in the least squares sense.

    What they leave open is as near as possible to the rotation nearest to `like` (3, 3).
    """
    u, _, vt = np.linalg.svd(like)
    turn = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
    centre, aim = points.mean(axis=0), aims.mean(axis=0)
    spread = (points - centre).T @ (points - centre)
    stiffness = RELATIVE_STIFFNESS * max(float(np.trace(spread)), 1e-12)
    affine = np.eye(4)
    affine[:3, :3] = ((aims - aim).T @ (points - centre) + stiffness * turn) @ np.linalg.inv(
        spread + stiffness * np.eye(3)
    )
    affine[:3, 3] = aim - affine[:3, :3] @ centre
    return affine
