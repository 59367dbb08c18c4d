"""Does a shape stand, what load does it bear, and what gives way first? (shapeassembly App. E, without a simulator)

The paper drops every connected component, as a rigid body, into a physics engine, pushes it a little, and calls the
shape unstable if a component's height changes. Here statics answers. A shape is stable if its bodies are in equilibrium
under gravity alone, and under gravity with each of a fixed set of pushes. Nothing moves, so nothing settles. A chair
that rocks on legs of unequal length within the ground tolerance is stable here. A shape that falls onto another side
and rests there at the same height is not. `settling` computes what the paper measures.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.components import connected_components
from stages.shape.geometry.polygons import convex_hull, inside_margin
from stages.shape.physics.contacts import ContactPatches, PairContacts
from stages.shape.physics.equilibrium import load_limits
from stages.shape.physics.settings import PhysicsConfig
from stages.shape.physics.solids import PlacedParts
from stages.shape.physics.tableau import TIE_TOLERANCE

TWIST_ARM_SHARE = 0.25
"""Lever arm of the twists, as a share of the diagonal: a twist of factor 1 is the part's weight at this arm."""
PUSH_DIRECTIONS = 8
MAX_PUSH = 1.0
"""Greatest push that is tried, in weights."""


@dataclass(frozen=True)
class Stability:
    """The stability of a shape.

    stable: whether the shape stands and bears every push of the config's size
    margin: greatest share of its weight, at most 1, by which it can be pushed in every direction; -1 if it does not
        stand
    weakest: part that gives way first, -1 if none does up to a push of full weight
    """

    stable: bool
    margin: float
    weakest: int


def standing_points(placed: PlacedParts, body_of: np.ndarray, tolerance: float) -> ContactPatches:
    """Return where bodies stand: for each body the hull of its points at most `tolerance` above the ground."""
    low = placed.spans[:, 0, 2] <= tolerance
    first, points = [], []
    for body in np.unique(body_of[low]).tolist():
        near = np.concatenate([placed.points[part] for part in np.flatnonzero(low & (body_of == body)).tolist()])
        near = near[near[:, 2] <= tolerance]
        corners = near[convex_hull(near[:, :2])]
        first.append(np.full(len(corners), body))
        points.append(corners)
    if not first:
        return _no_patches()
    bodies = np.concatenate(first)
    return ContactPatches(
        first=bodies,
        second=np.full(len(bodies), -1),
        patch=bodies,
        points=np.concatenate(points),
        normals=np.tile([0.0, 0.0, 1.0], (len(bodies), 1)),
    )


def tipping_angle(placed: PlacedParts, standing: ContactPatches) -> float:
    """Return by how many degrees the whole shape, if rigid, can be tilted before it tips over its support polygon.

    The direction is the one in which it tips soonest. A negative angle says how far it is beyond tipping.
    """
    centre = placed.weights @ placed.centroids
    inside = inside_margin(standing.points[:, :2], centre[:2])
    return float(np.degrees(np.arctan2(inside, max(centre[2], 1e-12 * placed.diagonal))))


def stability(
    placed: PlacedParts,
    touch: PairContacts,
    connected: IntArray,
    deep: IntArray,
    standing: ContactPatches,
    config: PhysicsConfig,
) -> Stability:
    """Return whether the shape stands, its margin, and its weakest part.

    connected: pairs of parts within the config's `connected`
    deep: those of them that penetrate deeper than `touching`
    standing: where parts stand on the ground, the bodies being the parts
    """
    count = len(placed)
    tolerance = config.touching * placed.diagonal
    pieces = connected_components(count, connected)
    between, pull = _no_patches(), np.empty(0)
    if config.joints == "dry":
        pieces, between = _dry_joints(placed, touch, connected, deep, tolerance)
        # A joint's pull is shared by its points.
        shares = np.bincount(between.patch, minlength=1)[between.patch]
        pull = config.tension / np.maximum(shares, 1)
    grounded = _reach(pieces, between, standing)
    if not grounded.all():
        return Stability(False, -1.0, int(np.argmin(grounded)))
    ground = _hulls_of(standing, pieces)
    patches = _joined(ground, between)
    pull = np.concatenate([np.zeros(len(ground.points)), pull])
    weights: FloatArray = np.bincount(pieces, placed.weights).astype(float)
    moments = np.stack([np.bincount(pieces, placed.weights * placed.centroids[:, k]) for k in range(3)], axis=1)
    centres = moments / np.maximum(weights, 1e-300)[:, None]
    size = placed.diagonal
    scaled = ContactPatches(patches.first, patches.second, patches.patch, patches.points / size, patches.normals)
    azimuth = _azimuth(placed)
    gravity = np.zeros((len(weights), 6))
    gravity[:, 2] = -weights
    loads = _pushes(weights, azimuth, bool(pull.any()))
    limits = load_limits(scaled, centres / size, gravity, loads, config.friction, pull, azimuth, MAX_PUSH)
    stands = bool((limits.factors >= 0).all())
    if not stands:
        empty = np.zeros_like(gravity)
        limits = load_limits(scaled, centres / size, empty, gravity[None], config.friction, pull, azimuth, 2.0)
    worst = int(np.flatnonzero(limits.factors <= limits.factors.min() + TIE_TOLERANCE)[0])
    margin = float(limits.factors[worst]) if stands else -1.0
    gives = not stands or margin < MAX_PUSH * (1 - 1e-9)
    return Stability(
        stable=stands and margin >= config.push * (1 - 1e-6),
        margin=margin,
        weakest=_fastest(placed, pieces, centres, limits.motions[worst]) if gives else -1,
    )


def _dry_joints(
    placed: PlacedParts, touch: PairContacts, connected: IntArray, deep: IntArray, tolerance: float
) -> tuple[np.ndarray, ContactPatches]:
    """Return the body of each part, where penetrating parts are one body, and the patches between bodies."""
    shallow = connected[~_among(connected, deep)]
    patches, locked = touch.patches(placed, shallow, tolerance)
    pieces = connected_components(len(placed), np.concatenate([deep, shallow[locked]]))
    first, second = pieces[patches.first], pieces[patches.second]
    apart = first != second
    return pieces, ContactPatches(
        first[apart], second[apart], patches.patch[apart], patches.points[apart], patches.normals[apart]
    )


def _among(pairs: IntArray, some: IntArray) -> np.ndarray:
    listed = {tuple(pair) for pair in some.tolist()}
    return np.array([tuple(pair) in listed for pair in pairs.tolist()], dtype=bool)


def _reach(pieces: np.ndarray, between: ContactPatches, standing: ContactPatches) -> np.ndarray:
    """Return whether the body of each part rests on the ground, directly or by other bodies, bool (n,)."""
    links = np.stack([between.first, between.second], axis=1).astype(np.int32)
    groups = connected_components(int(pieces.max()) + 1, links)
    grounded: np.ndarray = np.isin(groups[pieces], groups[pieces[standing.first]])
    return grounded


def _hulls_of(standing: ContactPatches, pieces: np.ndarray) -> ContactPatches:
    """Return the ground points of parts as hulls of the points of bodies."""
    bodies = pieces[standing.first]
    kept = []
    for body in np.unique(bodies).tolist():
        own = np.flatnonzero(bodies == body)
        kept.append(own[convex_hull(standing.points[own, :2])])
    rows = np.concatenate(kept)
    return ContactPatches(
        bodies[rows], standing.second[rows], bodies[rows], standing.points[rows], standing.normals[rows]
    )


def _azimuth(placed: PlacedParts) -> float:
    """Return a direction that turns with the shape about the vertical.

    It leads from the vertical through the centre of mass to the farthest point, the first of equals. The pushes are
    symmetric about it.
    """
    centre = (placed.weights @ placed.centroids)[:2]
    ways = np.concatenate(placed.points)[:, :2] - centre
    reach = (ways**2).sum(axis=1)
    way = ways[np.flatnonzero(reach >= reach.max() * (1 - 1e-9))[0]]
    return float(np.arctan2(way[1], way[0]))


def _pushes(weights: FloatArray, azimuth: float, glued: bool) -> FloatArray:
    """Return the loads that a stable shape bears in part, float64 (loads, n, 6), lengths in diagonals.

    Each part is pushed by its weight in eight level directions and twisted both ways about the vertical. If joints bear
    limited pull, each is also pushed up and down; without glue that only changes gravity.
    """
    angles = azimuth + 2 * np.pi * np.arange(PUSH_DIRECTIONS) / PUSH_DIRECTIONS
    level = np.stack([np.cos(angles), np.sin(angles), np.zeros(PUSH_DIRECTIONS)], axis=1)
    upright = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    pushed = np.concatenate([level, upright]) if glued else level
    unit = np.zeros((len(pushed) + 2, 6))
    unit[:-2, :3], unit[-2:, 3:] = pushed, TWIST_ARM_SHARE * upright
    return unit[:, None] * weights[:, None]


def _fastest(placed: PlacedParts, pieces: np.ndarray, centres: FloatArray, motion: FloatArray) -> int:
    """Return the part whose centroid moves most in a motion (n, 6) of the bodies, lengths in diagonals."""
    arms = (placed.centroids - centres[pieces]) / placed.diagonal
    moves = motion[pieces, :3] + np.cross(motion[pieces, 3:], arms)
    lengths = np.linalg.norm(moves, axis=1)
    return int(np.flatnonzero(lengths >= lengths.max() * (1 - 1e-6))[0])


def _joined(first: ContactPatches, second: ContactPatches) -> ContactPatches:
    return ContactPatches(
        first=np.concatenate([first.first, second.first]),
        second=np.concatenate([first.second, second.second]),
        patch=np.concatenate([first.patch, second.patch]),
        points=np.concatenate([first.points, second.points]),
        normals=np.concatenate([first.normals, second.normals]),
    )


def _no_patches() -> ContactPatches:
    nothing = np.empty(0, dtype=np.int64)
    return ContactPatches(nothing, nothing, nothing, np.empty((0, 3)), np.empty((0, 3)))
