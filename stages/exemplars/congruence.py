"""Congruence: the rigid transforms that move one part's surface onto another's, or onto itself."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from stages.shape.arrays import BoolArray, FloatArray, IntArray
from stages.shape.geometry.pose import rotation_angle
from stages.shape.geometry.triangles import triangle_areas

QUICK_CHECK_CORNERS = 24
MAX_CANDIDATES = 4096
MAX_CLOSE_DIFFERENCE = 0.2
"""Rotations whose entries differ more than this move the corners of any part."""
EXACT_TOLERANCE_SHARE = 0.1
"""Share of the tolerance within which a small rotation must map the part, to count as a symmetry of its own."""


@dataclass(frozen=True)
class ComparableMesh:
    """A mesh prepared for comparison.

    vertices: float64 (v, 3), distinct corners relative to the centroid.
    centroid: float64 (3,), area-weighted.
    tree: box tree of the mesh relative to the centroid.
    probes: float64 (p, 3), corners and triangle centres.
    radius: distance of the farthest corner from the centroid.
    """

    vertices: FloatArray
    centroid: FloatArray
    area: float
    tree: tuple[FloatArray, FloatArray, np.ndarray]
    probes: FloatArray
    diagonal: float
    radius: float

    @property
    def size(self) -> tuple[float, float, float]:
        """Area, radius and diagonal."""
        return self.area, self.radius, self.diagonal


def comparable_mesh(vertices: FloatArray, faces: IntArray) -> ComparableMesh:
    """Prepare the mesh `vertices` (v, 3), `faces` (f, 3) for `congruences`."""
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
        radius=float(np.linalg.norm(distinct, axis=1).max()),
    )


def are_alike_in_size(sizes: FloatArray, target: ComparableMesh, tolerance: float) -> BoolArray:
    """Return which meshes may be congruent to `target`, bool (k,).

    sizes: `size` of each, float64 (k, 3)
    """
    area, radius, diagonal = sizes.T
    slack = tolerance * diagonal
    has_area = np.abs(area - target.area) <= np.maximum(8 * slack * diagonal, 1e-2 * area)
    alike: BoolArray = has_area & (np.abs(radius - target.radius) <= 4 * slack)
    return alike


def congruences(source: ComparableMesh, target: ComparableMesh, tolerance: float, reflections: bool) -> FloatArray:
    """Return all rigid transforms (k, 4, 4) that move `source` onto `target` within `tolerance`.

    `tolerance` is a share of the diagonal. `reflections` admits transforms to the mirror image. With `source is target`
    the result is the part's symmetry group, the identity first; it is empty if the surfaces are not congruent. A
    transform is accepted if every corner and triangle centre of each surface falls on the other, so an open box is less
    symmetric than a closed one, and a surface of revolution has the symmetries of its tessellation. A rotation that
    moves no corner by more than `tolerance` compared with another would be accepted for any part, such as a small
    rotation of a long thin part about itself. It only counts if it is exact.
    """
    slack = tolerance * source.diagonal
    if not are_alike_in_size(np.array([source.size]), target, tolerance)[0]:
        return np.empty((0, 4, 4))
    # On a very thin part the frames of two corners are rounding errors, and no candidate may be the identity.
    accepted: list[FloatArray] = [np.eye(3)] if source is target else []
    for rotation in _candidate_rotations(source, target, slack, reflections):
        known = np.array(accepted).reshape(-1, 9)
        difference = np.abs(known - rotation.ravel()).max(axis=1)
        if (difference * source.diagonal < 4 * slack).any():
            continue
        close = known[difference < MAX_CLOSE_DIFFERENCE].reshape(-1, 3, 3)
        must_be_exact = _is_like_any(source.vertices, rotation, close, slack)
        if _maps_onto(source, target, rotation, EXACT_TOLERANCE_SHARE * slack if must_be_exact else slack):
            accepted.append(rotation)
    transforms = np.tile(np.eye(4), (len(accepted), 1, 1))
    for transform, rotation in zip(transforms, accepted, strict=True):
        transform[:3, :3] = rotation
        transform[:3, 3] = target.centroid - rotation @ source.centroid
    # Ordered by angle, then by the matrix itself, so that the identity is first and nothing depends on the search.
    rank = np.round(
        np.concatenate([rotation_angle(transforms)[:, None], transforms[:, :3, :3].reshape(-1, 9)], axis=1), 3
    )
    return transforms[np.lexsort(rank.T[::-1])]


def _is_like_any(vertices: FloatArray, rotation: FloatArray, others: FloatArray, slack: float) -> bool:
    """Return whether a rotation moves all corners (v, 3) to within `slack` of where one of `others` (k, 3, 3) does."""
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
    """Yield rotations that move two chosen corners of `source` to corners of `target`, and others onto its surface.

    Corners are relative to the centroid. Round parts have tens of thousands of rotations that pass the first test, so
    frames are computed together.
    """
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
    quick = corners[:: max(len(corners) // QUICK_CHECK_CORNERS, 1)]
    second = np.flatnonzero(np.abs(target_radius - radius[q]) <= 2 * slack)
    tried = 0
    for image in np.flatnonzero(np.abs(target_radius - radius[p]) <= 2 * slack):
        distance = np.linalg.norm(others[second] - others[image], axis=1)
        partners = second[np.abs(distance - gap) <= 4 * slack]
        partners = partners[np.linalg.norm(np.cross(others[image], others[partners]), axis=1) > 1e-9 * reach * reach]
        frames = _frames(others[image], others[partners])
        for other, quick_frame in zip(partners.tolist(), frames, strict=True):
            for turn in turns:
                # With a margin: frames computed together differ from one computed alone in their last digits.
                turned = np.ascontiguousarray(quick @ (quick_frame @ turn @ frame.T).T)
                if points_on_surface(*target.tree, turned, 1.01 * slack):
                    yield _frame(others[image], others[other]) @ turn @ frame.T
        tried += len(turns) * len(partners)
        if tried > MAX_CANDIDATES:
            break


def _shell_sizes(radius: FloatArray, target_radius: FloatArray, slack: float) -> IntArray:
    """Return for each source corner the number of target corners at the same distance from the centroid."""
    ranked = np.sort(target_radius)
    high = np.searchsorted(ranked, radius + 2 * slack, side="right")
    return (high - np.searchsorted(ranked, radius - 2 * slack, side="left")).astype(np.int32)


def _frame(p: FloatArray, q: FloatArray) -> FloatArray:
    x = p / np.sqrt(p.dot(p))
    z = _cross(p, q)
    z /= np.sqrt(z.dot(z))
    return np.ascontiguousarray(np.array([x, _cross(z, x), z]).T)


def _cross(p: FloatArray, q: FloatArray) -> FloatArray:
    """Return the cross product of two vectors (3,), in a tenth of NumPy's time."""
    (a, b, c), (d, e, f) = p.tolist(), q.tolist()
    return np.array([b * f - c * e, c * d - a * f, a * e - b * d])


def _frames(p: FloatArray, q: FloatArray) -> FloatArray:
    """Return the frames (k, 3, 3) of one corner `p` (3,) with each of `q` (k, 3), as `_frame` computes them."""
    x = np.broadcast_to(p / np.linalg.norm(p), q.shape)
    z = np.cross(p, q)
    z /= np.linalg.norm(z, axis=1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=2)


def _distinct(points: FloatArray, spacing: float) -> FloatArray:
    """Return one point of each cell of size `spacing`, in order of first appearance."""
    _, first = np.unique(np.round(points / spacing).astype(np.int64), axis=0, return_index=True)
    return np.ascontiguousarray(points[np.sort(first)])
