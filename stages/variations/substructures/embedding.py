"""Rigid embedding: where a piece goes, and what must make room for it (substructures §5.2).

What stays of the base may fall into several bodies that only the removed piece held together. The largest one keeps its
place and determines where the new piece goes; the new piece determines where the other bodies move.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose import invert, pose_vectors
from stages.shape.kit import Assembly, Kit
from stages.variations.kernels.structs import MIN_UPRIGHT_COSINE
from stages.variations.substructures.ordered_graph import OrderedGraph
from stages.variations.substructures.replacement import piece_of


@dataclass(frozen=True)
class Side:
    """One of the two shapes of an operation, with its ordered graph."""

    assembly: Assembly
    graph: OrderedGraph


@dataclass(frozen=True)
class Embedding:
    """The result of an embedding."""

    transform: FloatArray  # float64 (4, 4), moves the piece of the giver into the base
    poses: FloatArray
    """float64 (n, 4, 4), poses of the parts of the base afterwards; those that are taken out keep theirs."""


def pieces(base: Side, giver: Side, boundary: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what an operation takes out of the base, bool (n,), and what it copies from the giver, bool (m,)."""
    return piece_of(base.graph, boundary[:, 0]), piece_of(giver.graph, boundary[:, 1])


def embed(
    rng: np.random.Generator, kit: Kit, up: int, base: Side, giver: Side, boundary: np.ndarray, taken: np.ndarray
) -> Embedding | None:
    """Return the rigid transforms under which every boundary part of the giver lies on that of the base, or None.

    Where symmetries of a part allow several transforms, the one is taken under which most around the part coincides; of
    equals a random one.
    boundary: int64 (b, 2), darts as in `Operations`
    up: axis that transforms keep upright, or -1
    """
    rows = boundary[(boundary >= 0).all(axis=1)]
    bodies = _bodies(base.graph, taken)
    body_of = bodies[base.graph.tails[rows[:, 0]]]
    sizes = np.bincount(bodies[~taken])
    transform: FloatArray | None = None
    poses = base.assembly.poses.copy()
    for body in sorted(set(body_of.tolist()), key=lambda number: (-sizes[number], number)):
        own = rows[body_of == body]
        if transform is None:
            transform = _best(rng, kit, up, giver, base, own[:, ::-1], np.eye(4))
            if transform is None:
                return None
        else:
            move = _best(rng, kit, up, base, giver, own, transform)
            if move is None:
                return None
            poses[bodies == body] = move @ poses[bodies == body]
    return None if transform is None else Embedding(transform, poses)


def _bodies(graph: OrderedGraph, taken: np.ndarray) -> np.ndarray:
    """Return for each node that stays the number of its connected body, else -1; int64 (n,)."""
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
    """Return the transform (4, 4) that lays the boundary parts of one shape on those of the other, or None.

    rows: int64 (k, 2), their darts, those of the moved shape first
    frame: transform that was applied to the other shape before
    """
    transforms = transforms_onto(kit, moved, still, rows[0], frame)
    if up >= 0:
        transforms = transforms[transforms[:, up, up] >= MIN_UPRIGHT_COSINE]
    fits = [all(_coincide(kit, move, moved, still, row, frame) for row in rows[1:]) for move in transforms]
    transforms = transforms[fits]
    if not len(transforms):
        return None
    gaps = np.array([_gap(kit, move, moved, still, rows, frame) for move in transforms])
    closest = np.flatnonzero(gaps <= gaps.min() + kit.pose_tolerance)
    best: FloatArray = transforms[closest[int(rng.random() * len(closest))]]
    return best


def transforms_onto(
    kit: Kit, moved: Side, still: Side, row: Sequence[int] | np.ndarray, frame: FloatArray
) -> FloatArray:
    """Return all rigid transforms (s, 4, 4) under which one boundary part looks like the other, moved by `frame`.

    None for other meshes. row: their darts, that of the moved shape first
    """
    own, other = moved.graph.tails[row[0]], still.graph.tails[row[1]]
    if moved.assembly.types[own] != still.assembly.types[other]:
        return np.empty((0, 4, 4))
    symmetries = kit.types[moved.assembly.types[own]].symmetries
    transforms: FloatArray = frame @ still.assembly.poses[other] @ symmetries @ invert(moved.assembly.poses[own])
    return transforms


def _coincide(kit: Kit, transform: FloatArray, moved: Side, still: Side, row: np.ndarray, frame: FloatArray) -> bool:
    """Return whether a transform lays another boundary part on its image, up to symmetry."""
    images = transforms_onto(kit, moved, still, row, frame)
    if not len(images):
        return False
    own = moved.assembly.poses[moved.graph.tails[row[0]]]
    reach = kit.types[moved.assembly.types[moved.graph.tails[row[0]]]].diagonal / 2
    gaps = np.linalg.norm(pose_vectors(images @ own, reach) - pose_vectors((transform @ own)[None], reach), axis=1)
    return bool(gaps.min() <= kit.pose_tolerance)


def _gap(kit: Kit, transform: FloatArray, moved: Side, still: Side, rows: np.ndarray, frame: FloatArray) -> float:
    """Return how far apart parts around the boundary parts lie that docking sites lay on each other."""
    cut = set(rows[:, 0].tolist())
    total = 0.0
    for dart, image in rows.tolist():
        darts, images = moved.graph.around(dart), still.graph.around(image)
        for own, other in zip(darts, images, strict=False):
            if own not in cut:
                place = transform @ _centre(kit, moved, own) - frame @ _centre(kit, still, other)
                total += float(np.linalg.norm(place))
    return total


def _centre(kit: Kit, side: Side, dart: int) -> FloatArray:
    """Return the centroid of the part that a dart leads to, float64 (4,)."""
    part = side.graph.tails[side.graph.twins[dart]]
    centre: FloatArray = side.assembly.poses[part] @ np.append(kit.types[side.assembly.types[part]].centroid, 1.0)
    return centre
