"""Nearest neighbours and maxima over them, compiled: the parts of an edge convolution.

The published graph network makes a tensor (points, neighbours, 2 features) for each convolution. Here the linear part
is computed once for each point, and only the maximum of each feature over the neighbours is written.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numba
import numpy as np
import torch
from torch import Tensor

POINTS_PER_CELL = 2
"""Of the grid in which neighbours are searched."""


def nearest_neighbors(points: Tensor, k: int) -> Tensor:
    """Find the `k` nearest of each point in its own cloud, itself first.

    Exact; points at equal distances are in any order. In space each cloud is sorted into a grid. In other dimensions
    and on a GPU, all distances are computed.

    points: float (clouds, n, features)
    returns: int64 (clouds, n, k)
    """
    detached = points.detach()
    if detached.device.type == "cpu" and detached.shape[-1] == 3:
        return torch.from_numpy(_nearest_in_space(detached.float().contiguous().numpy(), k)).long()
    # in bfloat16, points at a hundredth's distance coincide
    with torch.autocast(detached.device.type, enabled=False):
        exact = detached.float()
        squares = (exact * exact).sum(dim=-1)
        closeness = 2.0 * exact @ exact.transpose(1, 2) - squares[:, None, :]
        return closeness.topk(k, dim=-1).indices


def edge_maximum(features: Tensor, neighbors: Tensor) -> Tensor:
    """Add to the first half of each point's features the maximum of the second half over its neighbours.

    features: float (clouds, n, 2 width)
    neighbors: int64 (clouds, n, k)
    returns: float (clouds, n, width)
    """
    function = _EdgeMaximum if features.device.type == "cpu" else _EdgeMaximumOnGpu
    edges: Tensor = function.apply(features, neighbors)  # type: ignore[no-untyped-call]
    return edges


class _EdgeMaximum(torch.autograd.Function):
    """The gradient goes to the neighbour with the maximum, the first of several."""

    @staticmethod
    def forward(ctx: Any, features: Tensor, neighbors: Tensor) -> Tensor:
        values = features.detach().float().contiguous().numpy()
        clouds, n, both = values.shape
        edges = np.empty((clouds, n, both // 2), np.float32)
        ctx.chosen = np.empty(edges.shape, np.int32)
        _maximum(values, neighbors.numpy(), edges, ctx.chosen)
        return torch.from_numpy(edges).to(features.dtype)

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, None]:
        incoming = gradient.float().contiguous().numpy()
        clouds, n, width = incoming.shape
        outgoing = np.zeros((clouds, n, 2 * width), np.float32)
        _scatter_gradient(incoming, ctx.chosen, outgoing)
        return torch.from_numpy(outgoing).to(gradient.dtype), None


class _EdgeMaximumOnGpu(torch.autograd.Function):
    """The same for a GPU, from tensors of all edges.

    A sum over many threads depends on their order, unless its terms are integers. Gradients are rounded to a millionth
    of the greatest and added as integers.
    """

    MAX_GRADIENT_STEPS = 2**20
    """The sum over 2,000 points still fits into an int32."""

    @staticmethod
    def forward(ctx: Any, features: Tensor, neighbors: Tensor) -> Tensor:
        own, others = features.chunk(2, dim=-1)
        clouds = torch.arange(len(features), device=features.device)[:, None, None]
        maximum, index = others[clouds, neighbors].max(dim=2)
        ctx.save_for_backward(neighbors.gather(-1, index))
        return own + maximum

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, None]:
        (chosen,) = ctx.saved_tensors
        step = gradient.detach().float().abs().amax().clamp(min=1e-30) / _EdgeMaximumOnGpu.MAX_GRADIENT_STEPS
        steps = (gradient.float() / step).round().to(torch.int32)
        with _nondeterministic():
            sums = torch.zeros_like(steps).scatter_add_(1, chosen, steps)
        return torch.cat([gradient, (sums * step).to(gradient.dtype)], dim=-1), None


@contextmanager
def _nondeterministic() -> Iterator[None]:
    """Sums of integers do not depend on their order, and any order is many times faster than a fixed one."""
    strict = torch.are_deterministic_algorithms_enabled()
    torch.use_deterministic_algorithms(False)
    try:
        yield
    finally:
        torch.use_deterministic_algorithms(strict)


@numba.njit(cache=True, fastmath=True)
def _maximum(features, neighbors, edges, chosen):
    clouds, n, width = edges.shape
    for cloud in range(clouds):
        for i in range(n):
            first = neighbors[cloud, i, 0]
            for f in range(width):
                edges[cloud, i, f] = features[cloud, first, width + f]
                chosen[cloud, i, f] = first
            for j in neighbors[cloud, i, 1:]:
                for f in range(width):
                    value = features[cloud, j, width + f]
                    better = value > edges[cloud, i, f]
                    edges[cloud, i, f] = value if better else edges[cloud, i, f]
                    chosen[cloud, i, f] = j if better else chosen[cloud, i, f]
            for f in range(width):
                edges[cloud, i, f] += features[cloud, i, f]


@numba.njit(cache=True)
def _scatter_gradient(incoming, chosen, outgoing):
    clouds, n, width = incoming.shape
    for cloud in range(clouds):
        for i in range(n):
            for f in range(width):
                outgoing[cloud, i, f] = incoming[cloud, i, f]
        for i in range(n):
            for f in range(width):
                outgoing[cloud, chosen[cloud, i, f], width + f] += incoming[cloud, i, f]


@numba.njit(cache=True)
def _nearest_in_space(points, k):
    clouds, n, _ = points.shape
    nearest = np.empty((clouds, n, k), np.int32)
    for cloud in range(clouds):
        _nearest_of_cloud(points[cloud], k, nearest[cloud])
    return nearest


@numba.njit(cache=True)
def _nearest_of_cloud(points, k, nearest):
    """Search rings of cells around a point until the k-th nearest is nearer than any cell that is left."""
    n = len(points)
    low = np.empty(3, np.float32)
    side = np.float32(0.0)
    for axis in range(3):
        low[axis] = points[:, axis].min()
        side = max(side, points[:, axis].max() - low[axis])
    # a surface passes through about 3 r^2 of r^3 cells
    r = min(max(int(np.sqrt(n / (3.0 * POINTS_PER_CELL))), 1), 64)
    size = side / r if side > 0.0 else np.float32(1.0)
    cell = np.empty((n, 3), np.int32)
    first = np.zeros(r * r * r + 1, np.int32)
    for i in range(n):
        for axis in range(3):
            cell[i, axis] = min(int((points[i, axis] - low[axis]) / size), r - 1)
        first[(cell[i, 0] * r + cell[i, 1]) * r + cell[i, 2] + 1] += 1
    for flat_cell in range(r * r * r):
        first[flat_cell + 1] += first[flat_cell]
    filled = first[:-1].copy()
    order = np.empty(n, np.int32)
    sorted_points = np.empty((n, 3), np.float32)
    for i in range(n):
        flat_cell = (cell[i, 0] * r + cell[i, 1]) * r + cell[i, 2]
        order[filled[flat_cell]] = i
        for axis in range(3):
            sorted_points[filled[flat_cell], axis] = points[i, axis]
        filled[flat_cell] += 1
    near = np.empty(k, np.float32)
    which = np.empty(k, np.int32)
    for i in range(n):
        count = 0
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        cx, cy, cz = cell[i, 0], cell[i, 1], cell[i, 2]
        for ring in range(r):
            if count == k:
                # the least distance of a cell of this ring
                gap = np.float32(ring - 1) * size
                inside = min(
                    min(x - low[0] - cx * size, (cx + 1) * size - x + low[0]),
                    min(y - low[1] - cy * size, (cy + 1) * size - y + low[1]),
                    min(z - low[2] - cz * size, (cz + 1) * size - z + low[2]),
                )
                gap += max(inside, np.float32(0.0))
                if near[k - 1] <= gap * gap:
                    break
            for a in range(max(cx - ring, 0), min(cx + ring, r - 1) + 1):
                for b in range(max(cy - ring, 0), min(cy + ring, r - 1) + 1):
                    shell = abs(a - cx) == ring or abs(b - cy) == ring
                    step = 1 if shell or ring == 0 else 2 * ring
                    c = cz - ring
                    while c <= cz + ring:
                        if 0 <= c < r:
                            flat_cell = (a * r + b) * r + c
                            for s in range(first[flat_cell], first[flat_cell + 1]):
                                dx = sorted_points[s, 0] - x
                                dy = sorted_points[s, 1] - y
                                dz = sorted_points[s, 2] - z
                                squared = dx * dx + dy * dy + dz * dz
                                if count < k or squared < near[k - 1]:
                                    slot = min(count, k - 1)
                                    while slot > 0 and near[slot - 1] > squared:
                                        near[slot] = near[slot - 1]
                                        which[slot] = which[slot - 1]
                                        slot -= 1
                                    near[slot] = squared
                                    which[slot] = order[s]
                                    count = min(count + 1, k)
                        c += step
        for slot in range(k):
            nearest[i, slot] = which[slot]
