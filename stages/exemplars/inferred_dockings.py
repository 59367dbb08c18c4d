"""Infer how parts whose surfaces never met may dock, from contacts of other parts of their meanings
(substructures §3, §4.1).

Each side of a contact is an anchor: its position and direction on the part, its size, and the part's orientation. Two
parts may dock if an anchor of the first, from a contact with the second's meaning, fits an anchor of the second, from a
contact with the first's meaning: a turned leg supports a seat as a square one did.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.contact import ContactTest
from stages.shape.geometry.docking import DockingTable, symmetric_images
from stages.shape.geometry.pose import invert, pose_vectors, transform_points
from stages.shape.kit import Assembly, ContactKind, Docking, PartType, labels_of

MAX_GAP_SHARE = 0.25
"""Largest distance of fitting anchors, as a share of the smaller contact, unless the pose tolerance is larger."""
MIN_SIZE_RATIO = 0.5
"""Size of the smaller contact over the larger, from which they fit; contacts below the tolerance always fit."""
ROTATION_TOLERANCE = 1e-3
"""Difference of entries up to which rotations are equal."""
MAX_FACING_COSINE = -0.5
"""Largest cosine between the outward normals of two fitting anchors."""
MAX_FLAT_THICKNESS = 0.25
"""Thickness up to which a contact has a normal, as a share of its width."""


@dataclass(frozen=True)
class _Anchor:
    """One side of a contact, in part coordinates.

    point: the middle of the box around the contact.
    normal: points out of the part; zero if the contact is not flat.
    rotation: of the part in the exemplar, float64 (3, 3).
    extent: the box's diagonal.
    """

    point: FloatArray
    normal: FloatArray
    rotation: FloatArray
    kind: ContactKind
    extent: float


def infer_dockings(
    types: Sequence[PartType], assemblies: Sequence[Assembly], dockings: Sequence[Docking], contact: ContactTest,
    tolerance: float, pose_tolerance: float,
) -> tuple[Docking, ...]:  # fmt: skip
    """Return the dockings that follow from the observed ones, for pairs of labels if one has several surfaces.

    Their count is 0. `slack` is how far from their pose they hold: `tolerance` at most, in the kit's units. Exemplars
    must face the same way, since a part replaces another in the orientation of its own exemplar. Every pair touches at
    its pose. `depth` is the largest between parts of these labels in contacts of this kind.

    assemblies: with the contacts that count, as `dockings` lists them.
    """
    labels = labels_of(types)[1].tolist()
    anchors = _anchors(types, assemblies, dockings, contact, pose_tolerance)
    deepest: dict[tuple[int, int, ContactKind], float] = {}
    for docking in dockings:
        for pair in ((labels[docking.a], labels[docking.b]), (labels[docking.b], labels[docking.a])):
            deepest[*pair, docking.kind] = max(deepest.get((*pair, docking.kind), 0.0), docking.depth)
    inferred: list[Docking] = []
    for (a, other), of_a in anchors.items():
        for (b, back), of_b in anchors.items():
            several = labels.count(labels[a]) > 1 or labels.count(labels[b]) > 1
            if a > b or other != labels[b] or back != labels[a] or not several:
                continue
            length = types[b].diagonal / 2
            near: list[tuple[FloatArray, float]] = []
            for first in of_a:
                for second in of_b:
                    pose = _fitting_pose(first, second, tolerance)
                    slack = max(pose_tolerance, min(tolerance, MAX_GAP_SHARE * min(first.extent, second.extent)))
                    if pose is None or _is_known(near, pose, length):
                        continue
                    if contact.touches(a, b, pose):
                        near.append((pose_vectors(symmetric_images(types[a], types[b], pose), length), slack))
                        depth = deepest[labels[a], labels[b], first.kind]
                        inferred.append(Docking(a, b, pose, first.kind, 0, depth, slack))
    return tuple(sorted(inferred, key=lambda docking: (docking.a, docking.b)))


def _fitting_pose(first: _Anchor, second: _Anchor, tolerance: float) -> FloatArray | None:
    """Return the pose (4, 4) of the second part in coordinates of the first at which their anchors fit; None if the
    anchors have different kinds or sizes, or do not face each other."""
    small, large = sorted((first.extent, second.extent))
    if first.kind != second.kind or (large > tolerance and small < MIN_SIZE_RATIO * large):
        return None
    pose = np.eye(4)
    pose[:3, :3] = first.rotation.T @ second.rotation
    pose[:3, 3] = first.point - pose[:3, :3] @ second.point
    if first.normal.any() and second.normal.any() and first.normal @ pose[:3, :3] @ second.normal > MAX_FACING_COSINE:
        return None
    return pose


def _is_known(near: Sequence[tuple[FloatArray, float]], pose: FloatArray, length: float) -> bool:
    """Return whether a known docking holds at `pose` with at most half of its slack."""
    vector = pose_vectors(pose[None], length)
    return any(np.linalg.norm(images - vector, axis=1).min() <= slack / 2 for images, slack in near)


def _anchors(
    types: Sequence[PartType], assemblies: Sequence[Assembly], dockings: Sequence[Docking], contact: ContactTest,
    tolerance: float,
) -> dict[tuple[int, int], list[_Anchor]]:  # fmt: skip
    """Return the anchors of each type for each label that it touches, in order of appearance."""
    labels = labels_of(types)[1].tolist()
    table = DockingTable(types, dockings, tolerance)
    anchors: dict[tuple[int, int], list[_Anchor]] = {}
    regions: dict[tuple[int, int, bytes], tuple[FloatArray, FloatArray, float]] = {}
    for assembly in assemblies:
        kinds = table.label_edges(assembly.types, assembly.poses, assembly.edges)[:, 0] // 2
        for (i, j), docking in zip(assembly.edges.tolist(), kinds.tolist(), strict=True):
            a, b = int(assembly.types[i]), int(assembly.types[j])
            pose = invert(assembly.poses[i]) @ assembly.poses[j]
            key = (a, b, np.round(pose / tolerance).astype(np.int64).tobytes())
            if key not in regions:
                points = contact.area(a, b, pose)
                regions[key] = _region(points, pose[:3, 3] - contact.types[a].centroid)
            middle, normal, extent = regions[key]
            back = invert(pose)
            for own, other, point, out, part in (
                (a, b, middle, normal, i),
                (b, a, transform_points(back, middle[None])[0], -back[:3, :3] @ normal, j),
            ):
                anchor = _Anchor(point, out, assembly.poses[part, :3, :3], dockings[docking].kind, extent)
                known = anchors.setdefault((own, labels[other]), [])
                if not any(_is_same_anchor(anchor, earlier, tolerance) for earlier in known):
                    known.append(anchor)
    return anchors


def _is_same_anchor(first: _Anchor, second: _Anchor, tolerance: float) -> bool:
    return (
        first.kind == second.kind
        and float(np.linalg.norm(first.point - second.point)) <= tolerance
        and float(np.abs(first.rotation - second.rotation).max()) <= ROTATION_TOLERANCE
    )


def _region(points: FloatArray, across: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Return the middle of the box around contact points (q, 3), the normal, and the box's diagonal.

    The normal lies on the side of the direction `across`; it is zero if the contact is not flat.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    centred = points - points.mean(axis=0)
    _, axes = np.linalg.eigh(centred.T @ centred)
    thickness, width, _ = np.ptp(centred @ axes, axis=0)
    normal = axes[:, 0] if thickness <= MAX_FLAT_THICKNESS * width else np.zeros(3)
    return (low + high) / 2, normal if normal @ across >= 0 else -normal, float(np.linalg.norm(high - low))
