"""Candidate rigid motions of a surface onto itself, by aligned corners that vote for them (symmetry §4.1)."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose import invert, rotation_angle
from stages.symmetry.matching.r_symmetry import matched_items
from stages.symmetry.surface.corner_frames import CornerFrames, corner_frames
from stages.symmetry.surface.grid import SurfaceGrid

MATES = 24
"""Each frame is aligned with so many of its kind, the nearest."""
FRAMES = 16_000
"""Of about so many frames, evenly through all of them, mates are looked for."""
CLUSTERS = 1500
"""So many clusters of motions are tried on a sample of the surface."""
SAMPLE = 400
"""Items of the surface on which a motion is tried."""
SHARE = 0.04
"""A motion that carries less of the sample onto the surface is let go."""
VOTES = 3
"""Corners that must agree on a motion."""
PLAIN = 1e-4
"""Radians below which a motion does not turn."""


def candidate_transforms(
    grid: SurfaceGrid, most: int, axis: FloatArray | None = None, frames: CornerFrames | None = None
) -> FloatArray:
    """At most `most` rigid motions (m, 4, 4) that carry parts of the surface onto it, that of the largest part first.

    Of a motion and its inverse one stands for both; the identity is none. Frames in corners of feature lines that agree
    in kind, and in the lengths of their edges where many do, are aligned; alignments are hashed into clusters, and
    those of many votes tried on a sample of the surface: thousands are pruned before the whole surface is looked at.
    axis: a direction, float64 (3,), that all of them keep; None for any. frames: in corners of feature lines; without,
    those of the grid's triangles.
    """
    found = corner_frames(grid.corners, grid.tolerance) if frames is None else frames
    middle = grid.corners.reshape(-1, 3).mean(axis=0)
    centred = found.frames.copy()
    centred[:, :3, 3] -= middle
    source, target = _mates(found, grid.radius)
    aligned = centred[target] @ invert(centred[source])
    reach = float(np.linalg.norm(np.ptp(grid.corners.reshape(-1, 3), axis=0))) / 2
    aligned = _one_of_each(aligned, grid.cell_size / reach)
    if axis is not None:
        aligned = aligned[np.linalg.norm(aligned[:, :3, :3] @ axis - axis, axis=1) * reach <= 2 * grid.cell_size]
    moves = rotation_angle(aligned) * reach + np.linalg.norm(aligned[:, :3, 3], axis=1) > grid.radius
    clusters = _clusters(aligned[moves], grid.cell_size, reach)
    motions = np.array([_agreed(each) for each in clusters]).reshape(-1, 4, 4)
    motions[:, :3, 3] += middle - motions[:, :3, :3] @ middle
    items = _sample(grid)
    shares = np.array([matched_items(grid, each, items).mean() for each in motions])
    order = np.argsort(-shares, kind="stable")
    return _apart(motions[order[shares[order] >= SHARE]], grid, middle, reach)[:most]


def _mates(found: CornerFrames, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of frames to align: each with the nearest of its kind, and with the nearest of its kind and its lengths."""
    from scipy.spatial import KDTree

    sources: list[np.ndarray] = []
    targets: list[np.ndarray] = []
    lengths = np.round(np.log(found.lengths / radius), 1) + 0.0
    for labels in (found.kinds, np.column_stack([found.kinds, lengths])):
        _, group = np.unique(labels, axis=0, return_inverse=True)
        order = np.argsort(group.reshape(-1), kind="stable")
        ends = np.flatnonzero(np.diff(group.reshape(-1)[order])) + 1
        for members in np.split(order, ends) if len(order) else []:
            if len(members) < 2:
                continue
            places, asked = found.frames[members, :3, 3], slice(None, None, 1 + len(found.frames) // FRAMES)
            _, near = KDTree(places).query(places[asked], k=min(len(members), MATES))
            sources.append(np.repeat(members[asked], near.shape[1]))
            targets.append(members[near.reshape(-1)])
    if not sources:
        return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
    source, target = np.concatenate(sources), np.concatenate(targets)
    return source[source != target], target[source != target]


def _one_of_each(motions: FloatArray, small: float) -> FloatArray:
    """The motions, of each and its inverse the one whose first displacement that is not small points along an axis."""
    skew = motions[:, [2, 0, 1], [1, 2, 0]] - motions[:, [1, 2, 0], [2, 0, 1]]
    numbers = np.column_stack([motions[:, :3, 3], skew])
    large = np.abs(numbers) > small * max(1.0, float(np.abs(numbers).max(initial=0)))
    first = large.argmax(axis=1)
    back = numbers[np.arange(len(numbers)), first] < 0
    turned: FloatArray = np.where(back[:, None, None], invert(motions), motions)
    return turned


def _vectors(motions: FloatArray, reach: float) -> FloatArray:
    """Motions as points whose distance is about how far apart they move the surface, float64 (m, 12)."""
    return np.column_stack([motions[:, :3, 3], reach * motions[:, :3, :3].reshape(-1, 9)])


def _clusters(motions: FloatArray, size: float, reach: float) -> list[FloatArray]:
    """Motions that fall into one bucket, the fullest bucket first."""
    buckets = np.round(_vectors(motions, reach) / (2 * size)).astype(np.int64)
    _, bucket, count = np.unique(buckets, axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(bucket.reshape(-1), kind="stable")
    groups = np.split(motions[order], np.cumsum(count)[:-1]) if len(count) else []
    ranked = np.argsort(-count, kind="stable")
    return [groups[each] for each in ranked[:CLUSTERS].tolist() if count[each] >= VOTES]


def _agreed(cluster: FloatArray) -> FloatArray:
    """The motion (4, 4) that a cluster agrees on: its mean rotation, none where it hardly turns, and the median of its
    displacements."""
    motion = np.eye(4)
    if rotation_angle(cluster[len(cluster) // 2]) > PLAIN:
        u, _, vt = np.linalg.svd(cluster[:, :3, :3].mean(axis=0))
        motion[:3, :3] = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    motion[:3, 3] = np.median(cluster[:, :3, 3], axis=0)
    return motion


def _sample(grid: SurfaceGrid) -> np.ndarray:
    """Items of the surface: of its boundary lines, of which planes of plain walls say nothing, as far as there are any,
    else of cells in which planes meet, evenly through the grid."""
    chosen = np.flatnonzero(grid.is_line)
    if not len(chosen):
        chosen = np.flatnonzero(np.diff(grid.starts)[grid.item_cell] > 1)
    if not len(chosen):
        chosen = np.arange(len(grid.points))
    return chosen[np.linspace(0, len(chosen) - 1, min(SAMPLE, len(chosen))).astype(np.int64)]


def _apart(motions: FloatArray, grid: SurfaceGrid, middle: FloatArray, reach: float) -> FloatArray:
    """The motions without those that move the surface like one before them."""
    if not len(motions):
        return motions
    about = motions.copy()
    about[:, :3, 3] = motions[:, :3, 3] + motions[:, :3, :3] @ middle - middle
    vectors = _vectors(about, reach)
    kept: list[int] = []
    for place in range(len(motions)):
        if not kept or np.linalg.norm(vectors[kept] - vectors[place], axis=1).min() > 2 * grid.cell_size:
            kept.append(place)
    return motions[kept]
