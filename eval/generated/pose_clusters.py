"""Clusters of relative poses over many shapes by mean shift, as strings §6 finds its edge categories."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose import pose_vectors, relative_poses
from stages.shape.kit import Assembly, Kit
from stages.strings.categories import CategorySpace

BANDWIDTH_TOLERANCES = 4.0
"""Radius of the flat kernel, in pose tolerances: less than between placements of a kit, more than noise."""
MAX_SHIFTS = 100


@dataclass(frozen=True)
class PoseClusters:
    """Clusters and categories of the edges of some shapes."""

    edges: int
    """Relative poses, each edge from both its ends."""
    known: int
    """Edge categories of the kit."""
    used: int
    """Categories of the edges."""
    clusters: int
    pure: int
    """Clusters that are one category each, which no other cluster has."""
    max_distance: float
    """Of a pose from the mean of its cluster, in pose tolerances."""


def mean_shift(
    poses: FloatArray, symmetries: FloatArray, length: float, bandwidth: float
) -> tuple[npt.NDArray[np.int64], FloatArray]:
    """Cluster poses (n, 4, 4) of a part, modulo its symmetries (k, 4, 4), by mean shift with a flat kernel.

    The mean of all poses within `bandwidth` is iterated from the first unclustered pose until it converges; of each
    pose the nearest symmetric image counts. All poses within `bandwidth` of it are one cluster. Distances are those of
    `pose_vectors` with `length`. Return the cluster of each pose, int64 (n,), and its distance from the cluster's mean,
    float64 (n,).
    """
    images = pose_vectors((poses[:, None] @ symmetries).reshape(-1, 4, 4), length).reshape(len(poses), -1, 12)
    rows = np.arange(len(poses))
    cluster, distance = np.full(len(poses), -1), np.full(len(poses), np.inf)
    while (cluster < 0).any():
        centre = images[int((cluster < 0).argmax()), 0]
        for _ in range(MAX_SHIFTS):
            gaps = np.linalg.norm(images - centre, axis=2)
            nearest = gaps.argmin(axis=1)
            near = gaps[rows, nearest] <= bandwidth
            before, centre = centre, images[rows[near], nearest[near]].mean(axis=0)
            if np.allclose(before, centre, rtol=0.0, atol=1e-9 * length):
                break
        gaps = np.linalg.norm(images - centre, axis=2).min(axis=1)
        members = (gaps <= bandwidth) & (cluster < 0)
        cluster[members], distance[members] = cluster.max() + 1, gaps[members]
    return cluster, distance


def cluster_poses(space: CategorySpace, shapes: Iterable[Assembly]) -> PoseClusters:
    """Cluster all edges of some shapes of a kit by pairs of types, and compare with the kit's categories."""
    kit = space.kit
    edges = used = clusters = pure = 0
    max_distance = 0.0
    for (a, b), poses in sorted(_relative(kit, shapes).items()):
        part = kit.types[b]
        cluster, distance = mean_shift(
            poses, part.symmetries, part.diagonal / 2, BANDWIDTH_TOLERANCES * kit.pose_tolerance
        )
        category = space.nearest(a, b, poses)[0]
        together = np.unique(np.stack([cluster, category], axis=1), axis=0)
        of_cluster, of_category = (np.bincount(column) for column in together.T)
        pure += int(((of_cluster[together[:, 0]] == 1) & (of_category[together[:, 1]] == 1)).sum())
        edges, clusters = edges + len(poses), clusters + len(of_cluster)
        used += len(np.unique(category))
        max_distance = max(max_distance, float(distance.max()) / kit.pose_tolerance)
    known = sum(len(pair.poses) for pair in space.pairs.values())
    return PoseClusters(edges, known, used, clusters, pure, max_distance)


def _relative(kit: Kit, shapes: Iterable[Assembly]) -> dict[tuple[int, int], FloatArray]:
    """Return the relative poses (n, 4, 4) of all edges, from both ends, by the types of both parts."""
    poses: dict[tuple[int, int], list[FloatArray]] = {}
    for shape in shapes:
        ends = np.concatenate([shape.edges, shape.edges[:, ::-1]])
        types = shape.types[ends]
        relative = relative_poses(shape.poses, ends)
        for a, b in np.unique(types, axis=0).tolist():
            poses.setdefault((a, b), []).append(relative[(types == (a, b)).all(axis=1)])
    return {pair: np.concatenate(of_pair) for pair, of_pair in poses.items()}
