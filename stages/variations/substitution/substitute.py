"""One try of substitution: choose, find the motion by which the piece docks to what stays, put both together.

The boundary of a substructure is its contacts with the rest (substructures §4.1). The motion is that of one of them,
fitted to all of them; whether the parts then touch as parts of their meanings do is for `connect` to say.
"""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray, TypeArray
from stages.shape.geometry.docking import DockingTable
from stages.shape.geometry.pose import invert, rigid_fit, rotation_angle
from stages.shape.kit import Assembly, Kit
from stages.variations.kernels.structs import (
    BOUNDARY,
    EDGES,
    PARTS,
    PIECE,
    TRY,
    UNKNOWNS,
    UPRIGHT,
    KitTables,
    Outcome,
    Workspace,
)
from stages.variations.kernels.variant_graph import inherit_edges, place_boxes
from stages.variations.search.parents import Parent
from stages.variations.substitution.pieces import Exchanged, draw_pieces

AS_IT_STOOD = 0.5
"""How likely the piece is turned as little as may be; else as one of the dockings at the place turns it."""
SAME_PLACE = 0.1
"""Dockings stand at one place if their centroids differ by less than this share of the part's diagonal."""

Docked = list[tuple[int, int, FloatArray]]
"""Parts of the piece with the part of the base that each docks to, and the pose (4, 4) which that docking gives it."""


def substitute(
    rng: np.random.Generator, kit: Kit, tables: KitTables, dockings: DockingTable, giver: Parent, base: Parent,
    ws: Workspace, smallest: int, largest: int,
) -> int:  # fmt: skip
    """Put a random piece of the giver into the base, in the workspace; the outcome of the try. After OK the contacts
    between the two are to be found by `connect`."""
    exchanged = draw_pieces(rng, kit.labelled(base.assembly), kit.labelled(giver.assembly))
    if exchanged is None:
        return Outcome.WHOLE
    parts = int(exchanged.piece.sum() + (~exchanged.taken).sum())
    if parts < smallest:
        return Outcome.TOO_SMALL
    if parts > largest:
        return Outcome.TOO_LARGE
    found = find_motion(rng, kit.label_of, dockings, giver.assembly, base.assembly, exchanged)
    if found is None or (tables.up >= 0 and found[0][tables.up, tables.up] < UPRIGHT):
        return Outcome.NO_MATCH
    put_together(tables, giver, base, exchanged, *found, ws)
    return Outcome.OK


def find_motion(
    rng: np.random.Generator, label_of: TypeArray, dockings: DockingTable, giver: Assembly, base: Assembly,
    exchanged: Exchanged,
) -> tuple[FloatArray, Docked] | None:  # fmt: skip
    """The rigid motion (4, 4) of the piece into the base, and what docks to what by it; None where nothing does."""
    boundary = _across(giver, exchanged.piece)
    if not len(boundary):
        return None
    inner, outer = boundary[int(rng.random() * len(boundary))].tolist()
    wanted = label_of[giver.types[[inner, outer]]]
    places = _across(base, exchanged.taken)
    places = places[(label_of[base.types[places]] == wanted).all(axis=1)]
    if len(places):
        old, hold = places[int(rng.random() * len(places))].tolist()
        aim = base.poses[old, :3, 3]
    else:
        holds = np.flatnonzero(~exchanged.taken & (label_of[base.types] == wanted[1]))
        if not len(holds):
            return None
        hold = int(holds[int(rng.random() * len(holds))])
        aim = (base.poses[hold] @ invert(giver.poses[outer]) @ giver.poses[inner])[:3, 3]
    poses = base.poses[hold] @ dockings.poses(int(base.types[hold]), int(giver.types[inner]))
    if not len(poses):
        return None
    gaps = np.linalg.norm(poses[:, :3, 3] - aim, axis=1)
    poses = poses[gaps <= gaps.min() + SAME_PLACE * dockings.types[giver.types[inner]].diagonal]
    motions = poses @ invert(giver.poses[inner])
    least = int(rotation_angle(motions).argmin())
    chosen = least if rng.random() < AS_IT_STOOD else int(rng.random() * len(motions))
    docked: Docked = [(inner, hold, poses[chosen])]
    docked += _docked(label_of, dockings, giver, base, exchanged, boundary, motions[chosen], (inner, outer))
    return _fitted(dockings, giver, docked), docked


def _across(assembly: Assembly, inside: np.ndarray) -> np.ndarray:
    """The contacts between parts that are `inside` and others, int (k, 2), the inner part first."""
    edges = assembly.edges
    ends = inside[edges]
    return np.concatenate([edges[ends[:, 0] & ~ends[:, 1]], edges[~ends[:, 0] & ends[:, 1]][:, ::-1]])


def _docked(
    label_of: TypeArray, dockings: DockingTable, giver: Assembly, base: Assembly, exchanged: Exchanged,
    boundary: np.ndarray, motion: FloatArray, besides: tuple[int, int],
) -> Docked:  # fmt: skip
    """What docks to what once the piece is moved, for all contacts of its boundary but one: of the parts that stay and
    are called what the contact's outer part is, the one that comes nearest to a docking."""
    docked: Docked = []
    for inner, outer in boundary.tolist():
        if (inner, outer) == besides:
            continue
        moved = motion @ giver.poses[inner]
        holds = np.flatnonzero(~exchanged.taken & (label_of[base.types] == label_of[giver.types[outer]]))
        found = [
            (gap, hold, base.poses[hold] @ pose)
            for hold in holds.tolist()
            for gap, pose in dockings.nearest(
                int(base.types[hold]), int(giver.types[inner]), invert(base.poses[hold]) @ moved
            )
        ]
        if found:
            _, hold, pose = min(found, key=lambda each: each[0])
            docked.append((inner, hold, pose))
    return docked


def _fitted(dockings: DockingTable, giver: Assembly, docked: Docked) -> FloatArray:
    """The motion that brings the parts of the piece nearest to the poses that their dockings give them, in the least
    squares sense: each counts with its centroid and its three axes."""
    source: list[FloatArray] = []
    target: list[FloatArray] = []
    for inner, _, pose in docked:
        reach = dockings.types[giver.types[inner]].diagonal / 2
        frame = np.concatenate([np.zeros((1, 3)), np.eye(3) * reach])
        for points, placed in ((source, giver.poses[inner]), (target, pose)):
            points.append(frame @ placed[:3, :3].T + placed[:3, 3])
    return rigid_fit(np.concatenate(source), np.concatenate(target))


def put_together(
    tables: KitTables, giver: Parent, base: Parent, exchanged: Exchanged, motion: FloatArray, docked: Docked,
    ws: Workspace,
) -> None:  # fmt: skip
    """Fill the workspace with the moved piece and what stays of the base, and the contacts that each brings.

    motion: float64 (4, 4), or (k, 4, 4) where each part of the piece has its own: then the piece brings no contacts.
    """
    ws.counts[TRY] += 1
    ws.counts[EDGES] = ws.counts[UNKNOWNS] = 0
    parts = 0
    moves = ((giver, exchanged.piece, ws.from_a, motion), (base, ~exchanged.taken, ws.from_b, np.eye(4)))
    for origin, (parent, chosen, places, move) in enumerate(moves):
        own = np.flatnonzero(chosen)
        here = slice(parts, parts + len(own))
        places[: len(chosen)] = -1
        places[own] = np.arange(here.start, here.stop)
        poses = move @ parent.assembly.poses[own] if origin == 0 else parent.assembly.poses[own]
        ws.types[here] = parent.assembly.types[own]
        ws.rotations[here], ws.translations[here] = poses[:, :3, :3], poses[:, :3, 3]
        ws.origin[here] = origin
        if origin == 1 or motion.ndim == 2:
            inherit_edges(parent.tables.starts, parent.tables.ends, parent.tables.labels, places, ws)
        parts = here.stop
    ws.counts[PARTS] = parts
    ws.counts[PIECE] = int(exchanged.piece.sum())
    ends = {inner: hold for inner, hold, _ in reversed(docked)}
    ws.counts[BOUNDARY] = len(ends)
    ws.boundary[: len(ends)], ws.images[: len(ends)] = list(ends), list(ends.values())
    told = motion if motion.ndim == 2 else motion[0]
    ws.motion[:3], ws.motion[3] = told[:3, :3], told[:3, 3]
    place_boxes(tables.boxes, ws.types, ws.rotations, ws.translations, parts, ws.boxes)
