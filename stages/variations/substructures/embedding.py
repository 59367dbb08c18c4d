"""Rigid embedding: where a piece comes to stand, and what must make room for it (substructures §5.2).

What stays of the base may fall into several pieces, which only what is taken out held together. The one with most parts
stays where it is and says where the new piece stands; the new piece says where the others move to.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose import invert, pose_vectors
from stages.shape.kit import Assembly, Kit
from stages.variations.kernels.structs import UPRIGHT
from stages.variations.substructures.ordered_graph import OrderedGraph
from stages.variations.substructures.replacement import piece_of


@dataclass(frozen=True)
class Side:
    """One of the two shapes of an operation, with its ordered graph and the name it has in lineages."""

    assembly: Assembly
    graph: OrderedGraph


@dataclass(frozen=True)
class Embedding:
    """motion: float64 (4, 4), moves the piece of the giver into the base; poses: float64 (n, 4, 4), where the parts of
    the base stand then, those that are taken out where they stood."""

    motion: FloatArray
    poses: FloatArray


def pieces(base: Side, giver: Side, boundary: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What an operation takes out of the base, bool (n,), and what it copies from the giver, bool (m,)."""
    return piece_of(base.graph, boundary[:, 0]), piece_of(giver.graph, boundary[:, 1])


def embed(
    rng: np.random.Generator, kit: Kit, up: int, base: Side, giver: Side, boundary: np.ndarray, taken: np.ndarray
) -> Embedding | None:
    """The rigid motions under which every boundary part of the giver comes to lie on that of the base.

    boundary: int64 (b, 2), darts as `Operations` says it; up: the axis that motions keep upright, or -1. Where a
    symmetry of a part leaves several motions, that is taken under which most around it coincides; of equals one at
    random. None where there is none.
    """
    rows = boundary[(boundary >= 0).all(axis=1)]
    bodies = _bodies(base.graph, taken)
    body_of = bodies[base.graph.tails[rows[:, 0]]]
    sizes = np.bincount(bodies[~taken])
    motion: FloatArray | None = None
    poses = base.assembly.poses.copy()
    for body in sorted(set(body_of.tolist()), key=lambda each: (-sizes[each], each)):
        own = rows[body_of == body]
        if motion is None:
            motion = _best(rng, kit, up, giver, base, own[:, ::-1], np.eye(4))
            if motion is None:
                return None
        else:
            move = _best(rng, kit, up, base, giver, own, motion)
            if move is None:
                return None
            poses[bodies == body] = move @ poses[bodies == body]
    return None if motion is None else Embedding(motion, poses)


def _bodies(graph: OrderedGraph, taken: np.ndarray) -> np.ndarray:
    """For each node that stays the number of the connected piece of such nodes that it is in, else -1; int64 (n,)."""
    bodies = np.full(len(taken), -1)
    for start in np.flatnonzero(~taken).tolist():
        if bodies[start] >= 0:
            continue
        number, waiting = bodies.max() + 1, [start]
        while waiting:
            node = waiting.pop()
            if bodies[node] < 0 and not taken[node]:
                bodies[node] = number
                waiting += graph.neighbours(node)
    return bodies


def _best(
    rng: np.random.Generator, kit: Kit, up: int, moved: Side, still: Side, rows: np.ndarray, frame: FloatArray
) -> FloatArray | None:
    """The motion (4, 4) that lays the boundary parts of one shape on those of the other, which `frame` moved before;
    rows int64 (k, 2) are their darts, those of the moved one first."""
    motions = motions_onto(kit, moved, still, rows[0], frame)
    if up >= 0:
        motions = motions[motions[:, up, up] >= UPRIGHT]
    motions = motions[[all(_coincide(kit, each, moved, still, row, frame) for row in rows[1:]) for each in motions]]
    if not len(motions):
        return None
    gaps = np.array([_gap(kit, each, moved, still, rows, frame) for each in motions])
    least = np.flatnonzero(gaps <= gaps.min() + kit.pose_tolerance)
    best: FloatArray = motions[least[int(rng.random() * len(least))]]
    return best


def motions_onto(kit: Kit, moved: Side, still: Side, row: Sequence[int] | np.ndarray, frame: FloatArray) -> FloatArray:
    """All motions (s, 4, 4) under which one boundary part looks like the other, which `frame` moved before; none where
    they are other meshes. row: their darts, that of the moved one first."""
    own, other = moved.graph.tails[row[0]], still.graph.tails[row[1]]
    if moved.assembly.types[own] != still.assembly.types[other]:
        return np.empty((0, 4, 4))
    symmetries = kit.types[moved.assembly.types[own]].symmetries
    motions: FloatArray = frame @ still.assembly.poses[other] @ symmetries @ invert(moved.assembly.poses[own])
    return motions


def _coincide(kit: Kit, motion: FloatArray, moved: Side, still: Side, row: np.ndarray, frame: FloatArray) -> bool:
    """Whether a motion lays one more boundary part upon its image, as one looks."""
    images = motions_onto(kit, moved, still, row, frame)
    if not len(images):
        return False
    own = moved.assembly.poses[moved.graph.tails[row[0]]]
    reach = kit.types[moved.assembly.types[moved.graph.tails[row[0]]]].diagonal / 2
    gaps = np.linalg.norm(pose_vectors(images @ own, reach) - pose_vectors((motion @ own)[None], reach), axis=1)
    return bool(gaps.min() <= kit.pose_tolerance)


def _gap(kit: Kit, motion: FloatArray, moved: Side, still: Side, rows: np.ndarray, frame: FloatArray) -> float:
    """How far apart the parts around the boundary parts come to stand that docking sites lay upon each other."""
    cut = set(rows[:, 0].tolist())
    total = 0.0
    for dart, image in rows.tolist():
        darts, images = moved.graph.around(dart), still.graph.around(image)
        for own, other in zip(darts, images, strict=False):
            if own not in cut:
                place = motion @ _centre(kit, moved, own) - frame @ _centre(kit, still, other)
                total += float(np.linalg.norm(place))
    return total


def _centre(kit: Kit, side: Side, dart: int) -> FloatArray:
    """The centroid of the part that a dart leads to, float64 (4,)."""
    part = side.graph.tails[side.graph.twins[dart]]
    centre: FloatArray = side.assembly.poses[part] @ np.append(kit.types[side.assembly.types[part]].centroid, 1.0)
    return centre
