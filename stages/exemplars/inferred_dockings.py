"""Fits: how parts whose surfaces never met may dock, because others of their meanings did (substructures §3, §4.1).

A contact is seen from each of its sides as an anchor: where on a part it lies, which way, how large, and how the part
stood. Two parts fit where the anchor of the one, from a contact with any part of the other's meaning, meets the anchor
of the other, from a contact with any part of the one's: a turned leg stands under a seat as a square one did.
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

OF_CONTACT = 0.25
"""Anchors miss each other by at most this share of the smaller contact, or by the pose tolerance."""
AS_LARGE = 0.5
"""Contacts fit if the smaller is at least this share of the larger; what is no larger than it may miss always is."""
SAME_TURN = 1e-3
"""Rotations whose entries differ by less are one."""
FACING = -0.5
"""Greatest cosine of the outward normals of two anchors that meet."""
FLAT = 0.25
"""A contact has a normal if its thickness is at most this share of its width."""


@dataclass(frozen=True)
class _Anchor:
    """One side of a contact, in the part's own coordinates. point: the middle of the box around it; normal: out of the
    part, zero where the contact is not flat; turn: how the part stood in the exemplar; extent: the box's diagonal."""

    point: FloatArray
    normal: FloatArray
    turn: FloatArray
    kind: ContactKind
    extent: float


def infer_dockings(
    types: Sequence[PartType], assemblies: Sequence[Assembly], dockings: Sequence[Docking], contact: ContactTest,
    tolerance: float, pose_tolerance: float,
) -> tuple[Docking, ...]:  # fmt: skip
    """The dockings that follow from those seen, for pairs of labels of which one has several surfaces.

    They were seen 0 times; `slack` says how far from their pose they hold: `tolerance` at most, in the kit's units.
    Exemplars must face one way: a part takes another's place as it stood in its own exemplar. Every pair touches at
    its pose; `depth` is what was seen between parts of these labels in contacts of this kind, and may not be passed.
    assemblies: with the contacts that count, as `dockings` lists them.
    """
    labels = labels_of(types)[1].tolist()
    anchors = _anchors(types, assemblies, dockings, contact, pose_tolerance)
    deepest: dict[tuple[int, int, ContactKind], float] = {}
    for each in dockings:
        for pair in ((labels[each.a], labels[each.b]), (labels[each.b], labels[each.a])):
            deepest[*pair, each.kind] = max(deepest.get((*pair, each.kind), 0.0), each.depth)
    found: list[Docking] = []
    for (a, other), of_a in anchors.items():
        for (b, back), of_b in anchors.items():
            several = labels.count(labels[a]) > 1 or labels.count(labels[b]) > 1
            if a > b or other != labels[b] or back != labels[a] or not several:
                continue
            length = types[b].diagonal / 2
            near: list[tuple[FloatArray, float]] = []
            for one in of_a:
                for two in of_b:
                    pose = _meeting(one, two, tolerance)
                    slack = max(pose_tolerance, min(tolerance, OF_CONTACT * min(one.extent, two.extent)))
                    if pose is None or _is_known(near, pose, length):
                        continue
                    if contact.touches(a, b, pose):
                        near.append((pose_vectors(symmetric_images(types[a], types[b], pose), length), slack))
                        depth = deepest[labels[a], labels[b], one.kind]
                        found.append(Docking(a, b, pose, one.kind, 0, depth, slack))
    return tuple(sorted(found, key=lambda each: (each.a, each.b)))


def _meeting(one: _Anchor, two: _Anchor, tolerance: float) -> FloatArray | None:
    """The pose (4, 4) of the second part in coordinates of the first where both stand as they did and their anchors
    meet, or None where these are of different kinds or sizes or do not face each other."""
    small, large = sorted((one.extent, two.extent))
    if one.kind != two.kind or (large > tolerance and small < AS_LARGE * large):
        return None
    pose = np.eye(4)
    pose[:3, :3] = one.turn.T @ two.turn
    pose[:3, 3] = one.point - pose[:3, :3] @ two.point
    if one.normal.any() and two.normal.any() and one.normal @ pose[:3, :3] @ two.normal > FACING:
        return None
    return pose


def _is_known(near: Sequence[tuple[FloatArray, float]], pose: FloatArray, length: float) -> bool:
    """Whether a fit that is known holds at `pose`, with half of its slack to spare."""
    vector = pose_vectors(pose[None], length)
    return any(np.linalg.norm(images - vector, axis=1).min() <= slack / 2 for images, slack in near)


def _anchors(
    types: Sequence[PartType], assemblies: Sequence[Assembly], dockings: Sequence[Docking], contact: ContactTest,
    tolerance: float,
) -> dict[tuple[int, int], list[_Anchor]]:  # fmt: skip
    """The anchors of each type for each label that it touches, in the order in which they are seen."""
    labels = labels_of(types)[1].tolist()
    table = DockingTable(types, dockings, tolerance)
    found: dict[tuple[int, int], list[_Anchor]] = {}
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
                known = found.setdefault((own, labels[other]), [])
                if not any(_same(anchor, each, tolerance) for each in known):
                    known.append(anchor)
    return found


def _same(one: _Anchor, two: _Anchor, tolerance: float) -> bool:
    return (
        one.kind == two.kind
        and float(np.linalg.norm(one.point - two.point)) <= tolerance
        and float(np.abs(one.turn - two.turn).max()) <= SAME_TURN
    )


def _region(points: FloatArray, across: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """A touching area by its points (q, 3): the middle of the box around it, its normal on the side of the direction
    `across` (zero where it is not flat), and the box's diagonal."""
    low, high = points.min(axis=0), points.max(axis=0)
    centred = points - points.mean(axis=0)
    _, axes = np.linalg.eigh(centred.T @ centred)
    thickness, width, _ = np.ptp(centred @ axes, axis=0)
    normal = axes[:, 0] if thickness <= FLAT * width else np.zeros(3)
    return (low + high) / 2, normal if normal @ across >= 0 else -normal, float(np.linalg.norm(high - low))
