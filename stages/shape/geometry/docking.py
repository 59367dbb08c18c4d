"""Looking up docking configurations: which observed relative pose, modulo symmetry, is this one? (strings §6)"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.pose import invert, pose_vectors
from stages.shape.kit import Docking, PartType

__all__ = ["DockingTable", "symmetric_images"]

SAME_IMAGE = 0.01
"""Images of a docking closer than this share of the tolerance are written once."""


def symmetric_images(a: PartType, b: PartType, pose: FloatArray) -> FloatArray:
    """All relative poses (k, 4, 4) of `b` against `a` that look the same as `pose`, by symmetries of either part."""
    left = a.symmetries @ pose
    images: FloatArray = (left[:, None] @ b.symmetries[None]).reshape(-1, 4, 4)
    return images


class DockingTable:
    """The dockings of a kit, found again by relative pose.

    A directed label says which docking an edge has as seen from one of its ends: `2 * index` where that end plays
    the part of `Docking.a`, `2 * index + 1` where it plays `Docking.b`, and always even where the two roles look
    the same. Unobserved poses have label -1.

    `tolerance` is the largest displacement between poses of one docking, in the units of the kit: of the centroid,
    and of a point half a diagonal away from it.
    """

    def __init__(self, types: Sequence[PartType], dockings: Sequence[Docking], tolerance: float) -> None:
        from scipy.spatial import cKDTree

        self.types = tuple(types)
        self.tolerance = tolerance
        entries: dict[tuple[int, int], list[tuple[FloatArray, int]]] = {}
        for index, docking in enumerate(dockings):
            forward = symmetric_images(self.types[docking.a], self.types[docking.b], docking.pose)
            entries.setdefault((docking.a, docking.b), []).append((forward, 2 * index))
            backward = symmetric_images(self.types[docking.b], self.types[docking.a], invert(docking.pose))
            entries.setdefault((docking.b, docking.a), []).append((backward, 2 * index + 1))
        self.images: dict[tuple[int, int], tuple[FloatArray, IntArray]] = {}
        for pair, found in sorted(entries.items()):
            poses = np.concatenate([images for images, _ in found])
            labels = np.concatenate([np.full(len(images), label, dtype=np.int32) for images, label in found])
            vectors = pose_vectors(poses, self.types[pair[1]].diagonal / 2)
            kept: list[int] = []
            place = np.full(len(vectors), -1)
            is_written = np.zeros(len(vectors), dtype=bool)
            tree = cKDTree(vectors)
            # Equal images are written once. Where two images of one docking are within tolerance both get the lower
            # label, so that a docking that is nearly its own inverse is even; both stay, for what lies at their sides.
            for candidate in np.argsort(labels, kind="stable").tolist():
                if is_written[candidate]:
                    continue
                beside = np.array(tree.query_ball_point(vectors[candidate], (1.0 + SAME_IMAGE) * tolerance))
                gaps = np.linalg.norm(vectors[beside] - vectors[candidate], axis=1)
                is_written[beside[gaps <= SAME_IMAGE * tolerance]] = True
                near = (place[beside] >= 0) & (gaps <= tolerance)
                if near.any():
                    nearest = beside[near][np.lexsort((place[beside[near]], gaps[near]))[0]]
                    if labels[nearest] // 2 == labels[candidate] // 2:
                        labels[candidate] = labels[nearest]
                place[candidate] = len(kept)
                kept.append(candidate)
            self.images[pair] = poses[kept], labels[kept]

    def label(self, a: int, b: int, poses: FloatArray) -> IntArray:
        """Directed labels int32 (m,), seen from the part of type `a`, of a part of type `b` at `poses` (m, 4, 4)."""
        if (a, b) not in self.images:
            return np.full(len(poses), -1, dtype=np.int32)
        length = self.types[b].diagonal / 2
        known, labels = self.images[a, b]
        gaps = np.linalg.norm(pose_vectors(known, length)[None] - pose_vectors(poses, length)[:, None], axis=2)
        nearest = gaps.argmin(axis=1)
        within = gaps[np.arange(len(poses)), nearest] <= (1.0 + SAME_IMAGE) * self.tolerance
        return np.where(within, labels[nearest], -1).astype(np.int32)

    def label_edges(self, types: np.ndarray, poses: FloatArray, edges: IntArray) -> IntArray:
        """Directed labels of all edges of an assembly, int32 (m, 2): seen from `edges[:, 0]` and from `edges[:, 1]`."""
        labels = np.empty((len(edges), 2), dtype=np.int32)
        for column in (0, 1):
            near, far = edges[:, column], edges[:, 1 - column]
            relative = invert(poses[near]) @ poses[far]
            pairs = np.stack([types[near], types[far]], axis=1)
            for a, b in np.unique(pairs, axis=0).tolist():
                chosen = np.flatnonzero((pairs[:, 0] == a) & (pairs[:, 1] == b))
                labels[chosen, column] = self.label(a, b, relative[chosen])
        return labels
