"""Congruence: the rigid motions that move one part's surface onto another's, or onto itself."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.pose import rotation_angle
from stages.shape.geometry.triangles import triangle_areas

QUICK_CHECK = 24
CANDIDATES = 4096
CLOSE = 0.2
"""Rotations with entries farther apart than this move corners of any part."""
EXACT = 0.1
"""Share of the tolerance within which a turn must be exact that moves nothing by more than the tolerance."""


@dataclass(frozen=True)
class ComparableMesh:
    """A mesh made ready for comparison.

    vertices: float64 (v, 3), distinct corners relative to the centroid; centroid: float64 (3,), area-weighted;
    tree: box tree of the mesh relative to the centroid; probes: float64 (p, 3), corners and triangle centres.
    """

    vertices: FloatArray
    centroid: FloatArray
    area: float
    tree: tuple[FloatArray, FloatArray, np.ndarray]
    probes: FloatArray
    diagonal: float


def comparable_mesh(vertices: FloatArray, faces: IntArray) -> ComparableMesh:
    """The mesh `vertices` (v, 3), `faces` (f, 3) made ready for `congruences`."""
    from stages.shape.geometry.mesh_pairs import build_tree

    corners = vertices[faces]
    areas = triangle_areas(corners)
    centroid = (corners.mean(axis=1) * areas[:, None]).sum(axis=0) / areas.sum()
    used = vertices[np.unique(faces)] - centroid
    diagonal = float(np.linalg.norm(np.ptp(used, axis=0)))
    distinct = _distinct(used, 1e-5 * diagonal)
    centres = corners.mean(axis=1) - centroid
    return ComparableMesh(
        vertices=distinct,
        centroid=centroid,
        area=float(areas.sum()),
        tree=build_tree(vertices - centroid, faces),
        probes=np.ascontiguousarray(np.concatenate([distinct, centres])),
        diagonal=diagonal,
    )


def congruences(source: ComparableMesh, target: ComparableMesh, tolerance: float, reflections: bool) -> FloatArray:
    """All rigid motions (k, 4, 4) that move `source` onto `target` within `tolerance`; with `reflections` also
    those that turn a part into its mirror image.

    `tolerance` is a share of the diagonal. With `source is target` this is the part's group of symmetries, the
    identity first. The result is empty where the surfaces are not congruent. A motion is accepted when every
    corner and triangle centre of each surface falls on the other, so an open box is not as symmetric as a closed
    one. Motions of surfaces of revolution are those that their tessellation allows. What moves no corner farther than
    `tolerance` from where another motion has it would be accepted whatever the part looks like, as a small turn of a
    long thin part about itself: it is a motion of its own only where it is exact.
    """
    slack = tolerance * source.diagonal
    if abs(source.area - target.area) > max(8 * slack * source.diagonal, 1e-2 * source.area):
        return np.empty((0, 4, 4))
    if np.ptp([np.linalg.norm(each.vertices, axis=1).max() for each in (source, target)]) > 4 * slack:
        return np.empty((0, 4, 4))
    # Of a part that is a hair thin the frames of two corners are rounding, and no candidate may be the identity.
    accepted: list[FloatArray] = [np.eye(3)] if source is target else []
    for rotation in _candidate_rotations(source, target, slack, reflections):
        known = np.array(accepted).reshape(-1, 9)
        apart = np.abs(known - rotation.ravel()).max(axis=1)
        if (apart * source.diagonal < 4 * slack).any():
            continue
        close = known[apart < CLOSE].reshape(-1, 3, 3)
        asked = EXACT * slack if _is_like_one(source.vertices, rotation, close, slack) else slack
        if _maps_onto(source, target, rotation, asked):
            accepted.append(rotation)
    motions = np.tile(np.eye(4), (len(accepted), 1, 1))
    for motion, rotation in zip(motions, accepted, strict=True):
        motion[:3, :3] = rotation
        motion[:3, 3] = target.centroid - rotation @ source.centroid
    # Ordered by angle, then by the matrix itself, so that the identity is first and nothing depends on the search.
    rank = np.round(np.concatenate([rotation_angle(motions)[:, None], motions[:, :3, :3].reshape(-1, 9)], axis=1), 3)
    return motions[np.lexsort(rank.T[::-1])]


def _is_like_one(vertices: FloatArray, rotation: FloatArray, others: FloatArray, slack: float) -> bool:
    """Whether a rotation moves no corner (v, 3) farther than `slack` from where one of some others (k, 3, 3) does."""
    return any(np.linalg.norm(vertices @ (rotation - other).T, axis=1).max() <= slack for other in others)


def _maps_onto(source: ComparableMesh, target: ComparableMesh, rotation: FloatArray, slack: float) -> bool:
    from stages.shape.geometry.mesh_pairs import points_on_surface

    for probes, onto, by in ((source.probes, target, rotation), (target.probes, source, rotation.T)):
        if not points_on_surface(*onto.tree, np.ascontiguousarray(probes @ by.T), slack):
            return False
    return True


def _candidate_rotations(
    source: ComparableMesh, target: ComparableMesh, slack: float, reflections: bool
) -> Iterator[FloatArray]:
    """Rotations that take two chosen corners of `source`, both relative to the centroid, to corners of `target`, and
    some more corners onto its surface. Round parts have tens of thousands that do the first alone, so those are turned
    all at once."""
    from stages.shape.geometry.mesh_pairs import points_on_surface

    corners, others = source.vertices, target.vertices
    radius, target_radius = np.linalg.norm(corners, axis=1), np.linalg.norm(others, axis=1)
    reach = radius.max()
    off_centre = np.flatnonzero(radius > 0.1 * reach)
    sizes = _shell_sizes(radius, target_radius, slack)
    p = min(off_centre, key=lambda i: (sizes[i] == 0, sizes[i], -radius[i]))
    sideways = np.linalg.norm(np.cross(corners, corners[p] / radius[p]), axis=1)
    off_axis = np.flatnonzero(sideways > 0.1 * sideways.max())
    q = min(off_axis, key=lambda i: (sizes[i] == 0, sizes[i], -sideways[i]))
    frame = _frame(corners[p], corners[q])
    gap = np.linalg.norm(corners[p] - corners[q])
    turns = [np.eye(3), np.diag([1.0, 1.0, -1.0])] if reflections else [np.eye(3)]
    quick = corners[:: max(len(corners) // QUICK_CHECK, 1)]
    second = np.flatnonzero(np.abs(target_radius - radius[q]) <= 2 * slack)
    tried = 0
    for image in np.flatnonzero(np.abs(target_radius - radius[p]) <= 2 * slack):
        distance = np.linalg.norm(others[second] - others[image], axis=1)
        found = second[np.abs(distance - gap) <= 4 * slack]
        found = found[np.linalg.norm(np.cross(others[image], others[found]), axis=1) > 1e-9 * reach * reach]
        frames = _frames(others[image], others[found])
        for other, each in zip(found.tolist(), frames, strict=True):
            for turn in turns:
                # With a hair of slack: frames made all at once differ from one made alone in their last digits.
                turned = np.ascontiguousarray(quick @ (each @ turn @ frame.T).T)
                if points_on_surface(*target.tree, turned, 1.01 * slack):
                    yield _frame(others[image], others[other]) @ turn @ frame.T
        tried += len(turns) * len(found)
        if tried > CANDIDATES:
            break


def _shell_sizes(radius: FloatArray, target_radius: FloatArray, slack: float) -> IntArray:
    """For each source corner the number of target corners at the same distance from the centroid."""
    ranked = np.sort(target_radius)
    high = np.searchsorted(ranked, radius + 2 * slack, side="right")
    return (high - np.searchsorted(ranked, radius - 2 * slack, side="left")).astype(np.int32)


def _frame(p: FloatArray, q: FloatArray) -> FloatArray:
    x = p / np.sqrt(p.dot(p))
    z = _cross(p, q)
    z /= np.sqrt(z.dot(z))
    return np.ascontiguousarray(np.array([x, _cross(z, x), z]).T)


def _cross(p: FloatArray, q: FloatArray) -> FloatArray:
    """The cross product of two vectors (3,), in a tenth of NumPy's time."""
    (a, b, c), (d, e, f) = p.tolist(), q.tolist()
    return np.array([b * f - c * e, c * d - a * f, a * e - b * d])


def _frames(p: FloatArray, q: FloatArray) -> FloatArray:
    """The frames (k, 3, 3) of one corner `p` (3,) with each of `q` (k, 3), as `_frame` has them."""
    x = np.broadcast_to(p / np.linalg.norm(p), q.shape)
    z = np.cross(p, q)
    z /= np.linalg.norm(z, axis=1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=2)


def _distinct(points: FloatArray, spacing: float) -> FloatArray:
    """`points` with those that fall into the same cell of size `spacing` merged, in order of first appearance."""
    _, first = np.unique(np.round(points / spacing).astype(np.int64), axis=0, return_index=True)
    return np.ascontiguousarray(points[np.sort(first)])
