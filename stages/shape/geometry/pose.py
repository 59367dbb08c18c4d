"""Poses: rigid transforms as float64 (4, 4) matrices acting on column vectors, or stacks (n, 4, 4) of them."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray

POSE_DECIMALS = 12


def invert(poses: FloatArray) -> FloatArray:
    """Return the inverse of rigid transforms (..., 4, 4)."""
    rotation = np.swapaxes(poses[..., :3, :3], -1, -2)
    inverse = np.zeros_like(poses)
    inverse[..., :3, :3] = rotation
    inverse[..., :3, 3] = -np.einsum("...ij,...j->...i", rotation, poses[..., :3, 3])
    inverse[..., 3, 3] = 1.0
    return inverse


def relative_poses(poses: FloatArray, edges: np.ndarray) -> FloatArray:
    """Return the pose of part `edges[:, 1]` in the coordinates of part `edges[:, 0]`, (m, 4, 4)."""
    relative: FloatArray = invert(poses[edges[:, 0]]) @ poses[edges[:, 1]]
    return relative


def transform_points(pose: FloatArray, points: FloatArray) -> FloatArray:
    """Return `points` (n, 3) moved by one rigid transform (4, 4)."""
    moved: FloatArray = points @ pose[:3, :3].T + pose[:3, 3]
    return moved


def rotation_angle(pose: FloatArray) -> FloatArray:
    """Return the angle of the rotation part of (..., 4, 4) in radians, in [0, pi]."""
    trace = np.trace(pose[..., :3, :3], axis1=-2, axis2=-1)
    angle: FloatArray = np.arccos(np.clip((trace - 1.0) / 2.0, -1.0, 1.0))
    return angle


def pose_vectors(poses: FloatArray, length: float) -> FloatArray:
    """Return poses (n, 4, 4) as points (n, 12) of a Euclidean space in which distance means displacement.

    The three translation entries are kept, and the nine rotation entries are multiplied by `length`. So two poses that
    differ by a turn of `a` radians about the origin are about `length * a * sqrt(2)` apart.
    """
    vectors = np.empty((len(poses), 12))
    vectors[:, :3] = poses[:, :3, 3]
    vectors[:, 3:] = poses[:, :3, :3].reshape(-1, 9) * length
    return vectors


def rounded(numbers: FloatArray) -> FloatArray:
    """Return `numbers` as records store them, without the noise of their last digits and without minus zeros."""
    return np.round(numbers, POSE_DECIMALS) + 0.0


def rigid_fit(source: FloatArray, target: FloatArray) -> FloatArray:
    """Return the rigid transform (4, 4) that moves `source` (n, 3) onto `target` (n, 3) with least squared error.

    By SVD of the 3x3 covariance, without reflection (strings §4, docking transformation estimation).
    """
    source_centre, target_centre = source.mean(axis=0), target.mean(axis=0)
    u, _, vt = np.linalg.svd((source - source_centre).T @ (target - target_centre))
    handedness = np.sign(np.linalg.det(vt.T @ u.T))
    rotation = vt.T @ np.diag([1.0, 1.0, handedness if handedness != 0 else 1.0]) @ u.T
    pose = np.eye(4)
    pose[:3, :3] = rotation
    pose[:3, 3] = target_centre - rotation @ source_centre
    return pose
