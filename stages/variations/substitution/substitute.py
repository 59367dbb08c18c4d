"""One try of substitution: draw parts, find the rigid transform by which the piece docks, put both together.

The boundary of a substructure is its contacts with the rest (substructures §4.1). The transform is that of one of them,
fitted to the others; `connect` then says whether the parts touch as parts of their labels do.
"""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray, TypeArray
from stages.shape.geometry.docking import DockingTable
from stages.shape.geometry.pose import invert, rigid_fit, rotation_angle
from stages.shape.kit import Assembly, Kit
from stages.variations.kernels.outcomes import Outcome
from stages.variations.kernels.structs import (
    MIN_UPRIGHT_COSINE,
    N_BOUNDARY,
    N_EDGES,
    N_PARTS,
    N_PIECE_PARTS,
    N_UNKNOWNS,
    TRY_NUMBER,
    KitTables,
    Workspace,
)
from stages.variations.kernels.variant_graph import inherit_edges, place_boxes
from stages.variations.search.parents import Parent
from stages.variations.substitution.pieces import Exchanged, draw_pieces

LEAST_TURN_PROBABILITY = 0.5
"""Probability that the piece is turned as little as possible; otherwise it is turned as one of the dockings says."""
SAME_PLACE_SHARE = 0.1
"""Dockings are at one place if their centroids differ by less than this share of the part's diagonal."""

Docked = list[tuple[int, int, FloatArray]]
"""Parts of the piece, the part of the base that each docks to, and the pose (4, 4) that the docking gives it."""


def substitute(
    rng: np.random.Generator, kit: Kit, tables: KitTables, dockings: DockingTable, giver: Parent, base: Parent,
    ws: Workspace, min_parts: int, max_parts: int,
) -> int:  # fmt: skip
    """Put a random piece of the giver into the base, in the workspace; return the outcome.

    After OK the contacts between the two must be found by `connect`.
    """
    exchanged = draw_pieces(rng, kit.labelled(base.assembly), kit.labelled(giver.assembly))
    if exchanged is None:
        return Outcome.WHOLE
    parts = int(exchanged.piece.sum() + (~exchanged.taken).sum())
    if parts < min_parts:
        return Outcome.TOO_SMALL
    if parts > max_parts:
        return Outcome.TOO_LARGE
    docking = find_docking(rng, kit.label_of, dockings, giver.assembly, base.assembly, exchanged)
    if docking is None or (tables.up >= 0 and docking[0][tables.up, tables.up] < MIN_UPRIGHT_COSINE):
        return Outcome.NO_MATCH
    put_together(tables, giver, base, exchanged, *docking, ws)
    return Outcome.OK


def find_docking(
    rng: np.random.Generator, label_of: TypeArray, dockings: DockingTable, giver: Assembly, base: Assembly,
    exchanged: Exchanged,
) -> tuple[FloatArray, Docked] | None:  # fmt: skip
    """Return the rigid transform (4, 4) of the piece into the base and what docks to what by it, or None."""
    boundary = _across(giver, exchanged.piece)
    if not len(boundary):
        return None
    inner, outer = boundary[int(rng.random() * len(boundary))].tolist()
    wanted = label_of[giver.types[[inner, outer]]]
    base_boundary = _across(base, exchanged.taken)
    base_boundary = base_boundary[(label_of[base.types[base_boundary]] == wanted).all(axis=1)]
    if len(base_boundary):
        old, anchor = base_boundary[int(rng.random() * len(base_boundary))].tolist()
        aim = base.poses[old, :3, 3]
    else:
        holds = np.flatnonzero(~exchanged.taken & (label_of[base.types] == wanted[1]))
        if not len(holds):
            return None
        anchor = int(holds[int(rng.random() * len(holds))])
        aim = (base.poses[anchor] @ invert(giver.poses[outer]) @ giver.poses[inner])[:3, 3]
    poses = base.poses[anchor] @ dockings.poses(int(base.types[anchor]), int(giver.types[inner]))
    if not len(poses):
        return None
    gaps = np.linalg.norm(poses[:, :3, 3] - aim, axis=1)
    poses = poses[gaps <= gaps.min() + SAME_PLACE_SHARE * dockings.types[giver.types[inner]].diagonal]
    transforms = poses @ invert(giver.poses[inner])
    least_turn = int(rotation_angle(transforms).argmin())
    chosen = least_turn if rng.random() < LEAST_TURN_PROBABILITY else int(rng.random() * len(transforms))
    docked: Docked = [(inner, anchor, poses[chosen])]
    docked += _docked(label_of, dockings, giver, base, exchanged, boundary, transforms[chosen], (inner, outer))
    return _fitted(dockings, giver, docked), docked


def _across(assembly: Assembly, inside: np.ndarray) -> np.ndarray:
    """Return the contacts between parts `inside` and others, int (k, 2), the inner part first."""
    edges = assembly.edges
    ends = inside[edges]
    return np.concatenate([edges[ends[:, 0] & ~ends[:, 1]], edges[~ends[:, 0] & ends[:, 1]][:, ::-1]])


def _docked(
    label_of: TypeArray, dockings: DockingTable, giver: Assembly, base: Assembly, exchanged: Exchanged,
    boundary: np.ndarray, transform: FloatArray, known: tuple[int, int],
) -> Docked:  # fmt: skip
    """Return what docks to what once the piece is moved, for all contacts of its boundary but one.

    Of the parts that stay with the label of the contact's outer part it is the one nearest to a docking.
    """
    docked: Docked = []
    for inner, outer in boundary.tolist():
        if (inner, outer) == known:
            continue
        moved = transform @ giver.poses[inner]
        anchors = np.flatnonzero(~exchanged.taken & (label_of[base.types] == label_of[giver.types[outer]]))
        dockings_near = [
            (gap, anchor, base.poses[anchor] @ pose)
            for anchor in anchors.tolist()
            for gap, pose in dockings.nearest(
                int(base.types[anchor]), int(giver.types[inner]), invert(base.poses[anchor]) @ moved
            )
        ]
        if dockings_near:
            _, anchor, pose = min(dockings_near, key=lambda docking: docking[0])
            docked.append((inner, anchor, pose))
    return docked


def _fitted(dockings: DockingTable, giver: Assembly, docked: Docked) -> FloatArray:
    """Return the transform that brings the parts of the piece nearest to the poses of their dockings (least squares).

    Each part counts with its centroid and its three axes.
    """
    source: list[FloatArray] = []
    target: list[FloatArray] = []
    for inner, _, pose in docked:
        reach = dockings.types[giver.types[inner]].diagonal / 2
        frame = np.concatenate([np.zeros((1, 3)), np.eye(3) * reach])
        for points, placed in ((source, giver.poses[inner]), (target, pose)):
            points.append(frame @ placed[:3, :3].T + placed[:3, 3])
    return rigid_fit(np.concatenate(source), np.concatenate(target))


def put_together(
    tables: KitTables, giver: Parent, base: Parent, exchanged: Exchanged, transform: FloatArray, docked: Docked,
    ws: Workspace,
) -> None:  # fmt: skip
    """Fill the workspace with the moved piece and what stays of the base, and the contacts that each brings.

    transform: float64 (4, 4), or (k, 4, 4) where each part of the piece has its own; then the piece brings no contacts
    """
    ws.counts[TRY_NUMBER] += 1
    ws.counts[N_EDGES] = ws.counts[N_UNKNOWNS] = 0
    parts = 0
    moves = ((giver, exchanged.piece, ws.from_a, transform), (base, ~exchanged.taken, ws.from_b, np.eye(4)))
    for origin, (parent, chosen, part_of, applied) in enumerate(moves):
        own = np.flatnonzero(chosen)
        rows = slice(parts, parts + len(own))
        part_of[: len(chosen)] = -1
        part_of[own] = np.arange(rows.start, rows.stop)
        poses = applied @ parent.assembly.poses[own] if origin == 0 else parent.assembly.poses[own]
        ws.types[rows] = parent.assembly.types[own]
        ws.rotations[rows], ws.translations[rows] = poses[:, :3, :3], poses[:, :3, 3]
        ws.origin[rows] = origin
        if origin == 1 or transform.ndim == 2:
            inherit_edges(parent.tables.starts, parent.tables.ends, parent.tables.labels, part_of, ws)
        parts = rows.stop
    ws.counts[N_PARTS] = parts
    ws.counts[N_PIECE_PARTS] = int(exchanged.piece.sum())
    ends = {inner: anchor for inner, anchor, _ in reversed(docked)}
    ws.counts[N_BOUNDARY] = len(ends)
    ws.boundary[: len(ends)], ws.images[: len(ends)] = list(ends), list(ends.values())
    recorded = transform if transform.ndim == 2 else transform[0]
    ws.transform[:3], ws.transform[3] = recorded[:3, :3], recorded[:3, 3]
    place_boxes(tables.boxes, ws.types, ws.rotations, ws.translations, parts, ws.boxes)
