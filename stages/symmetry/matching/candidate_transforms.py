"""Candidate rigid transforms of a surface onto itself, by aligned corners that vote for them (symmetry §4.1)."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose import invert, rotation_angle
from stages.symmetry.matching.r_symmetry import matched_items
from stages.symmetry.surface.corner_frames import CornerFrames, corner_frames
from stages.symmetry.surface.grid import SurfaceGrid

MATES_PER_FRAME = 24
"""Nearest frames of the same kind with which a frame is aligned."""
MAX_FRAMES = 16_000
"""About the number of frames, taken evenly, for which mates are searched."""
MAX_CLUSTERS = 1500
"""Clusters of transforms that are tested on a sample of the surface."""
SAMPLE_ITEMS = 400
"""Items of the surface on which a transform is tested."""
MIN_MATCHED_SHARE = 0.04
"""Transforms that map less of the sample onto the surface are dropped."""
MIN_VOTES = 3
"""Corners that must agree on a transform."""
NO_TURN_RADIANS = 1e-4
"""A transform that turns less is a translation."""


def candidate_transforms(
    grid: SurfaceGrid, limit: int, axis: FloatArray | None = None, frames: CornerFrames | None = None
) -> FloatArray:
    """Find at most `limit` rigid transforms (m, 4, 4) that map parts of the surface onto it, the largest part first.

    axis: direction float64 (3,) that every transform must keep; None for any
    frames: in corners of feature lines; those of the grid's triangles if None

    A transform stands for its inverse too, and the identity is left out. Frames that agree in kind are aligned, and
    also frames that agree in the lengths of their edges. Alignments are hashed into clusters. Clusters with many votes
    are tested on a sample, so that thousands are dropped without a test of the whole surface.
    """
    known = corner_frames(grid.corners, grid.tolerance) if frames is None else frames
    middle = grid.corners.reshape(-1, 3).mean(axis=0)
    centred = known.frames.copy()
    centred[:, :3, 3] -= middle
    source, target = _mates(known, grid.radius)
    aligned = centred[target] @ invert(centred[source])
    reach = float(np.linalg.norm(np.ptp(grid.corners.reshape(-1, 3), axis=0))) / 2
    aligned = _canonical_directions(aligned, grid.cell_size / reach)
    if axis is not None:
        aligned = aligned[np.linalg.norm(aligned[:, :3, :3] @ axis - axis, axis=1) * reach <= 2 * grid.cell_size]
    moves = rotation_angle(aligned) * reach + np.linalg.norm(aligned[:, :3, 3], axis=1) > grid.radius
    clusters = _clusters(aligned[moves], grid.cell_size, reach)
    transforms = np.array([_consensus(cluster) for cluster in clusters]).reshape(-1, 4, 4)
    transforms[:, :3, 3] += middle - transforms[:, :3, :3] @ middle
    items = _sample(grid)
    shares = np.array([matched_items(grid, transform, items).mean() for transform in transforms])
    order = np.argsort(-shares, kind="stable")
    return _distinct(transforms[order[shares[order] >= MIN_MATCHED_SHARE]], grid, middle, reach)[:limit]


def _mates(known: CornerFrames, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Return pairs of frames to align: nearest ones of the same kind, and of the same kind and lengths."""
    from scipy.spatial import KDTree

    sources: list[np.ndarray] = []
    targets: list[np.ndarray] = []
    lengths = np.round(np.log(known.lengths / radius), 1) + 0.0
    for labels in (known.kinds, np.column_stack([known.kinds, lengths])):
        _, group = np.unique(labels, axis=0, return_inverse=True)
        order = np.argsort(group.reshape(-1), kind="stable")
        ends = np.flatnonzero(np.diff(group.reshape(-1)[order])) + 1
        for members in np.split(order, ends) if len(order) else []:
            if len(members) < 2:
                continue
            positions, queried = known.frames[members, :3, 3], slice(None, None, 1 + len(known.frames) // MAX_FRAMES)
            _, near = KDTree(positions).query(positions[queried], k=min(len(members), MATES_PER_FRAME))
            sources.append(np.repeat(members[queried], near.shape[1]))
            targets.append(members[near.reshape(-1)])
    if not sources:
        return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
    source, target = np.concatenate(sources), np.concatenate(targets)
    return source[source != target], target[source != target]


def _canonical_directions(transforms: FloatArray, small: float) -> FloatArray:
    """Replace transforms by their inverses where the first displacement that is not small is negative."""
    skew = transforms[:, [2, 0, 1], [1, 2, 0]] - transforms[:, [1, 2, 0], [2, 0, 1]]
    numbers = np.column_stack([transforms[:, :3, 3], skew])
    large = np.abs(numbers) > small * max(1.0, float(np.abs(numbers).max(initial=0)))
    first = large.argmax(axis=1)
    back = numbers[np.arange(len(numbers)), first] < 0
    canonical: FloatArray = np.where(back[:, None, None], invert(transforms), transforms)
    return canonical


def _vectors(transforms: FloatArray, reach: float) -> FloatArray:
    """Return vectors (m, 12) whose distances are about how differently the transforms move the surface."""
    return np.column_stack([transforms[:, :3, 3], reach * transforms[:, :3, :3].reshape(-1, 9)])


def _clusters(transforms: FloatArray, size: float, reach: float) -> list[FloatArray]:
    """Group transforms that fall into one bucket, the fullest bucket first."""
    buckets = np.round(_vectors(transforms, reach) / (2 * size)).astype(np.int64)
    _, bucket, count = np.unique(buckets, axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(bucket.reshape(-1), kind="stable")
    groups = np.split(transforms[order], np.cumsum(count)[:-1]) if len(count) else []
    ranked = np.argsort(-count, kind="stable")
    return [groups[number] for number in ranked[:MAX_CLUSTERS].tolist() if count[number] >= MIN_VOTES]


def _consensus(cluster: FloatArray) -> FloatArray:
    """Return the transform (4, 4) of a cluster: its mean rotation, if it turns, and its median displacement."""
    transform = np.eye(4)
    if rotation_angle(cluster[len(cluster) // 2]) > NO_TURN_RADIANS:
        u, _, vt = np.linalg.svd(cluster[:, :3, :3].mean(axis=0))
        transform[:3, :3] = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    transform[:3, 3] = np.median(cluster[:, :3, 3], axis=0)
    return transform


def _sample(grid: SurfaceGrid) -> np.ndarray:
    """Return items evenly through the grid: boundary lines, else items of cells in which planes meet, else any.

    Lines come first because planes of plain walls match almost everywhere.
    """
    chosen = np.flatnonzero(grid.is_line)
    if not len(chosen):
        chosen = np.flatnonzero(np.diff(grid.starts)[grid.item_cell] > 1)
    if not len(chosen):
        chosen = np.arange(len(grid.points))
    return chosen[np.linspace(0, len(chosen) - 1, min(SAMPLE_ITEMS, len(chosen))).astype(np.int64)]


def _distinct(transforms: FloatArray, grid: SurfaceGrid, middle: FloatArray, reach: float) -> FloatArray:
    """Drop transforms that move the surface like an earlier one."""
    if not len(transforms):
        return transforms
    about = transforms.copy()
    about[:, :3, 3] = transforms[:, :3, 3] + transforms[:, :3, :3] @ middle - middle
    vectors = _vectors(about, reach)
    kept: list[int] = []
    for index in range(len(transforms)):
        if not kept or np.linalg.norm(vectors[kept] - vectors[index], axis=1).min() > 2 * grid.cell_size:
            kept.append(index)
    return transforms[kept]
