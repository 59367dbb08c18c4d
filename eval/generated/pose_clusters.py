"""Clusters of relative poses over many shapes, as strings §6 finds its edge categories: by mean shift."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose import pose_vectors, relative_poses
from stages.shape.kit import Assembly, Kit
from stages.strings.categories import CategorySpace

BANDWIDTH = 4.0
"""Radius of the flat kernel, in tolerances of poses: places of a kit are further apart, and noise is less."""
MOST_SHIFTS = 100


@dataclass(frozen=True)
class Clusters:
    """edges: relative poses that were looked at, each edge from both its ends; known: categories of edges that the kit
    has; used: categories that edges have; found: clusters; pure: clusters whose poses have one category, and no other
    cluster has it; spread: the greatest distance of a pose from the mean of its cluster, in tolerances."""

    edges: int
    known: int
    used: int
    found: int
    pure: int
    spread: float


def mean_shift(
    poses: FloatArray, symmetries: FloatArray, length: float, bandwidth: float
) -> tuple[npt.NDArray[np.int64], FloatArray]:
    """Clusters of poses (n, 4, 4) of a part, modulo its symmetries (k, 4, 4), by mean shift with a flat kernel.

    From the first pose that has no cluster yet, the mean of all poses within `bandwidth` is taken until it stands
    still, of each pose the symmetric one that is nearest; what is within `bandwidth` of it then is one cluster.
    Distances are those of `pose_vectors` with `length`. Answers the cluster of each pose, int64 (n,), and its distance
    from the mean of its cluster, (n,).
    """
    images = pose_vectors((poses[:, None] @ symmetries).reshape(-1, 4, 4), length).reshape(len(poses), -1, 12)
    rows = np.arange(len(poses))
    cluster, distance = np.full(len(poses), -1), np.full(len(poses), np.inf)
    while (cluster < 0).any():
        centre = images[int((cluster < 0).argmax()), 0]
        for _ in range(MOST_SHIFTS):
            gaps = np.linalg.norm(images - centre, axis=2)
            nearest = gaps.argmin(axis=1)
            near = gaps[rows, nearest] <= bandwidth
            before, centre = centre, images[rows[near], nearest[near]].mean(axis=0)
            if np.allclose(before, centre, rtol=0.0, atol=1e-9 * length):
                break
        gaps = np.linalg.norm(images - centre, axis=2).min(axis=1)
        taken = (gaps <= bandwidth) & (cluster < 0)
        cluster[taken], distance[taken] = cluster.max() + 1, gaps[taken]
    return cluster, distance


def clusters_of(space: CategorySpace, shapes: Iterable[Assembly]) -> Clusters:
    """The clusters of all edges of some shapes of a kit, pair by pair of types, beside its categories."""
    kit = space.kit
    edges = known = used = found = pure = 0
    spread = 0.0
    for (a, b), poses in sorted(_relative(kit, shapes).items()):
        part = kit.types[b]
        cluster, distance = mean_shift(poses, part.symmetries, part.diagonal / 2, BANDWIDTH * kit.pose_tolerance)
        category = space.nearest(a, b, poses)[0]
        together = np.unique(np.stack([cluster, category], axis=1), axis=0)
        of_cluster, of_category = (np.bincount(column) for column in together.T)
        pure += int(((of_cluster[together[:, 0]] == 1) & (of_category[together[:, 1]] == 1)).sum())
        edges, found = edges + len(poses), found + len(of_cluster)
        used += len(np.unique(category))
        spread = max(spread, float(distance.max()) / kit.pose_tolerance)
    known = sum(len(each.poses) for each in space.pairs.values())
    return Clusters(edges, known, used, found, pure, spread)


def _relative(kit: Kit, shapes: Iterable[Assembly]) -> dict[tuple[int, int], FloatArray]:
    """The relative poses (n, 4, 4) of all edges, seen from both ends, by the types of both parts."""
    poses: dict[tuple[int, int], list[FloatArray]] = {}
    for shape in shapes:
        ends = np.concatenate([shape.edges, shape.edges[:, ::-1]])
        types = shape.types[ends]
        relative = relative_poses(shape.poses, ends)
        for a, b in np.unique(types, axis=0).tolist():
            poses.setdefault((a, b), []).append(relative[(types == (a, b)).all(axis=1)])
    return {pair: np.concatenate(each) for pair, each in poses.items()}
