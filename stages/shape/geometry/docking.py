"""Look up docking configurations: which observed relative pose, modulo symmetry, is this one? (strings §6)"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.pose import invert, pose_vectors
from stages.shape.kit import Docking, Kit, PartType

SAME_IMAGE = 0.01
"""Images of a docking closer than this share of the tolerance are stored once."""


def symmetric_images(a: PartType, b: PartType, pose: FloatArray) -> FloatArray:
    """Return all relative poses (k, 4, 4) of `b` against `a` equal to `pose` up to symmetries of either part."""
    left = a.symmetries @ pose
    images: FloatArray = (left[:, None] @ b.symmetries[None]).reshape(-1, 4, 4)
    return images


class DockingTable:
    """The dockings of a kit, looked up by relative pose.

    A directed label says which docking an edge has as seen from one of its ends. It is `2 * index` if that end has the
    role of `Docking.a`, `2 * index + 1` if it has that of `Docking.b`, and even if both roles look the same. Unobserved
    poses have label -1.

    tolerance: largest displacement between poses of one docking, in the units of the kit: of the centroid, and of a
        point half a diagonal away from it

    Dockings that were never observed but follow from others have their own tolerance, `Docking.slack`; only `fit` uses
    them.
    """

    def __init__(self, types: Sequence[PartType], dockings: Sequence[Docking], tolerance: float) -> None:
        from stages.shape.geometry.images import distinct_images

        self.types = tuple(types)
        self.tolerance = tolerance
        entries: dict[tuple[int, int], list[tuple[FloatArray, int]]] = {}
        self._fits: dict[tuple[int, int], list[tuple[FloatArray, float, int]]] = {}
        self._fit_poses: dict[tuple[int, int], list[FloatArray]] = {}
        self._poses: dict[tuple[int, int], tuple[FloatArray, FloatArray]] = {}
        self.reach = 2 * max([tolerance, *(docking.slack for docking in dockings)])
        for index, docking in enumerate(dockings):
            if docking.slack:
                self._add_fit(index, docking)
                continue
            forward = symmetric_images(self.types[docking.a], self.types[docking.b], docking.pose)
            entries.setdefault((docking.a, docking.b), []).append((forward, 2 * index))
            backward = symmetric_images(self.types[docking.b], self.types[docking.a], invert(docking.pose))
            entries.setdefault((docking.b, docking.a), []).append((backward, 2 * index + 1))
        self.images: dict[tuple[int, int], tuple[FloatArray, IntArray]] = {}
        self._vectors: dict[tuple[int, int], FloatArray] = {}
        for pair, of_pair in sorted(entries.items()):
            poses = np.concatenate([images for images, _ in of_pair])
            labels = np.concatenate([np.full(len(images), label, dtype=np.int32) for images, label in of_pair])
            vectors = pose_vectors(poses, self.types[pair[1]].diagonal / 2)
            # Equal images are written once. Where two images of one docking are within tolerance both get the lower
            # label, so that a docking that is nearly its own inverse is even; both stay, for what lies at their sides.
            kept = distinct_images(vectors, labels, tolerance, SAME_IMAGE * tolerance)
            self.images[pair] = poses[kept], labels[kept]
            self._vectors[pair] = vectors[kept]

    @classmethod
    def of(cls, kit: Kit) -> DockingTable:
        """Return the dockings of a kit's grammar."""
        return cls(kit.types, kit.grammar.dockings, kit.pose_tolerance)

    def label(self, a: int, b: int, poses: FloatArray) -> IntArray:
        """Return the directed labels int32 (m,) of a part of type `b` at `poses` (m, 4, 4), seen from the part of type
        `a`.
        """
        if (a, b) not in self.images:
            return np.full(len(poses), -1, dtype=np.int32)
        from stages.shape.geometry.images import nearest_image

        vectors = pose_vectors(poses, self.types[b].diagonal / 2)
        nearest, gaps = nearest_image(self._vectors[a, b], vectors)
        labels, within = self.images[a, b][1], gaps <= (1.0 + SAME_IMAGE) * self.tolerance
        return np.where(within, labels[nearest], -1).astype(np.int32)

    def _add_fit(self, index: int, docking: Docking) -> None:
        a, b = self.types[docking.a], self.types[docking.b]
        images = pose_vectors(symmetric_images(a, b, docking.pose), b.diagonal / 2)
        self._fits.setdefault((docking.a, docking.b), []).append((images, docking.slack, index))
        self._fit_poses.setdefault((docking.a, docking.b), []).append(docking.pose)

    def fit(self, a: int, b: int, pose: FloatArray) -> tuple[int, int] | None:
        """Return the directed labels of an unobserved docking that holds for a part of type `b` at `pose` (4, 4), or
        None.

        The labels are as seen from the part of type `a` and from the other. The docking nearest by its slack is taken.
        Both sides give the same answer.
        """
        forward = [(gap, index, 0) for gap, index in self._nearest_fit(a, b, pose)]
        backward = [(gap, index, 1) for gap, index in self._nearest_fit(b, a, invert(pose))]
        if not forward and not backward:
            return None
        _, index, turned = min(forward + backward)
        if {label for _, label, _ in forward} == {label for _, label, _ in backward}:
            return 2 * index, 2 * index
        return 2 * index + turned, 2 * index + 1 - turned

    def poses(self, a: int, b: int) -> FloatArray:
        """Return all poses (k, 4, 4) in which a part of type `b` docks to one of type `a`, observed ones first."""
        if (a, b) not in self._poses:
            first, second = self.types[a], self.types[b]
            fits = [*self._fit_poses.get((a, b), ()), *map(invert, self._fit_poses.get((b, a), ()))]
            seen = self.images[a, b][0] if (a, b) in self.images else np.empty((0, 4, 4))
            all_poses = np.concatenate([seen, *(symmetric_images(first, second, pose) for pose in fits)])
            self._poses[a, b] = all_poses, pose_vectors(all_poses, second.diagonal / 2)
        return self._poses[a, b][0]

    def nearest(self, a: int, b: int, pose: FloatArray) -> list[tuple[float, FloatArray]]:
        """Return the pose of `poses` nearest to `pose` (4, 4) and the gap between them, if it is at most `reach`."""
        poses = self.poses(a, b)
        gaps = np.linalg.norm(self._poses[a, b][1] - pose_vectors(pose[None], self.types[b].diagonal / 2), axis=1)
        if not len(gaps) or gaps.min() > self.reach:
            return []
        return [(float(gaps.min()), poses[int(gaps.argmin())])]

    def _nearest_fit(self, a: int, b: int, pose: FloatArray) -> list[tuple[float, int]]:
        """Return the fit of an ordered pair of types nearest to a pose: its gap in units of slack, and its index."""
        vector = pose_vectors(pose[None], self.types[b].diagonal / 2)
        gaps = [
            (float(np.linalg.norm(images - vector, axis=1).min()) / slack, index)
            for images, slack, index in self._fits.get((a, b), ())
        ]
        return [min(gaps)] if gaps and min(gaps)[0] <= 1.0 else []

    def label_edges(self, types: np.ndarray, poses: FloatArray, edges: IntArray) -> IntArray:
        """Return the directed labels of all edges of an assembly, int32 (m, 2): from `edges[:, 0]` and from `edges[:,
        1]`.
        """
        labels = np.empty((len(edges), 2), dtype=np.int32)
        for column in (0, 1):
            near, far = edges[:, column], edges[:, 1 - column]
            relative = invert(poses[near]) @ poses[far]
            pairs = np.stack([types[near], types[far]], axis=1)
            for a, b in np.unique(pairs, axis=0).tolist():
                chosen = np.flatnonzero((pairs[:, 0] == a) & (pairs[:, 1] == b))
                labels[chosen, column] = self.label(a, b, relative[chosen])
        return labels
