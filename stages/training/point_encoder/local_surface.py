"""What the surface is like around each point of a cloud: its normal, and how its points spread. Compiled."""

from __future__ import annotations

import numba
import numpy as np
import torch
from torch import Tensor

NEIGHBOR_COUNTS = (8, 16, 32)
"""Of the nearest points, the point itself among them: fine, middle and coarse."""
FEATURES_PER_COUNT = 9
MAX_SWEEPS = 8
"""Rotations about the three axes, repeated; a matrix of three rows needs about four."""


def local_surface(points: Tensor, neighbors: Tensor) -> Tensor:
    """Describe the surface around each point by the principal axes of its nearest 8, 16 and 32 points.

    For each of these counts, nine numbers: the outer product of the normal with itself, which is the same for both
    directions of it (xx, yy, zz, xy, xz, yz), and the square roots of the three eigenvalues' shares of their sum, in
    ascending order. A flat surface has 0 as the first of them, points on a line 0 and 0. Coincident points have zeros.
    Where there are fewer neighbours, all are taken. Gradients do not flow through it.

    points: float (clouds, n, 3)
    neighbors: indices of the nearest points of each, nearest first, int64 (clouds, n, k)
    returns: float32 (clouds, n, 27), on the device of the points
    """
    found = np.empty((*points.shape[:2], len(NEIGHBOR_COUNTS) * FEATURES_PER_COUNT), np.float32)
    counts = np.minimum(NEIGHBOR_COUNTS, neighbors.shape[2])
    _describe(points.detach().float().cpu().contiguous().numpy(), neighbors.cpu().numpy(), counts, found)
    return torch.from_numpy(found).to(points.device)


@numba.njit(cache=True)
def _describe(points, neighbors, counts, found):
    matrix, axes = np.empty((3, 3)), np.empty((3, 3))
    for cloud in range(len(points)):
        for i in range(points.shape[1]):
            for scale in range(len(counts)):
                _covariance(points[cloud], neighbors[cloud, i], counts[scale], i, matrix)
                _diagonalize(matrix, axes)
                _write_features(matrix, axes, found[cloud, i, scale * FEATURES_PER_COUNT :])


@numba.njit(cache=True)
def _covariance(points, nearest, count, i, matrix):
    """Offsets from the point itself are small, so that little is lost when the squared mean is subtracted."""
    mean = np.zeros(3)
    matrix[:] = 0.0
    for k in range(count):
        j = nearest[k]
        for a in range(3):
            first = np.float64(points[j, a]) - points[i, a]
            mean[a] += first / count
            for b in range(a, 3):
                matrix[a, b] += first * (np.float64(points[j, b]) - points[i, b]) / count
    for a in range(3):
        for b in range(a, 3):
            matrix[a, b] -= mean[a] * mean[b]
            matrix[b, a] = matrix[a, b]


@numba.njit(cache=True)
def _diagonalize(matrix, axes):
    """Rotate a symmetric matrix until it is diagonal (Jacobi); the columns of `axes` become its eigenvectors."""
    axes[:] = 0.0
    for a in range(3):
        axes[a, a] = 1.0
    scale = matrix[0, 0] + matrix[1, 1] + matrix[2, 2]
    for _ in range(MAX_SWEEPS):
        if abs(matrix[0, 1]) + abs(matrix[0, 2]) + abs(matrix[1, 2]) <= 1e-14 * scale:
            return
        for a in range(2):
            for b in range(a + 1, 3):
                if matrix[a, b] != 0.0:
                    ratio = (matrix[b, b] - matrix[a, a]) / (2.0 * matrix[a, b])
                    tangent = (1.0 if ratio >= 0.0 else -1.0) / (abs(ratio) + np.sqrt(ratio * ratio + 1.0))
                    cosine = 1.0 / np.sqrt(tangent * tangent + 1.0)
                    sine = tangent * cosine
                    for c in range(3):
                        first, second = matrix[a, c], matrix[b, c]
                        matrix[a, c] = cosine * first - sine * second
                        matrix[b, c] = sine * first + cosine * second
                    for c in range(3):
                        first, second = matrix[c, a], matrix[c, b]
                        matrix[c, a] = cosine * first - sine * second
                        matrix[c, b] = sine * first + cosine * second
                        first, second = axes[c, a], axes[c, b]
                        axes[c, a] = cosine * first - sine * second
                        axes[c, b] = sine * first + cosine * second


@numba.njit(cache=True)
def _write_features(matrix, axes, found):
    low, high = 0, 0
    for a in range(1, 3):
        low = a if matrix[a, a] < matrix[low, low] else low
        high = a if matrix[a, a] >= matrix[high, high] else high
    total = matrix[0, 0] + matrix[1, 1] + matrix[2, 2]
    if total <= 0.0:
        found[:FEATURES_PER_COUNT] = 0.0
        return
    x, y, z = axes[0, low], axes[1, low], axes[2, low]
    found[0], found[1], found[2] = x * x, y * y, z * z
    found[3], found[4], found[5] = x * y, x * z, y * z
    found[6] = np.sqrt(max(matrix[low, low], 0.0) / total)
    found[7] = np.sqrt(max(matrix[3 - low - high, 3 - low - high], 0.0) / total)
    found[8] = np.sqrt(max(matrix[high, high], 0.0) / total)
