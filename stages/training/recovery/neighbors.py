"""Nearest neighbours and what they say at most, compiled: what an edge convolution is made of.

A graph network as published makes a tensor (points, neighbours, 2 features) for each convolution. Here the linear part
is done once a point, and only the greatest of each feature over the neighbours is ever written.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numba
import numpy as np
import torch
from torch import Tensor

CELL_POINTS = 2
"""Points in a cell of the grid that the neighbours of points in space are looked for in."""


def nearest_neighbors(points: Tensor, k: int) -> Tensor:
    """The `k` nearest of each point in its own cloud, the point itself the first, int64 (clouds, n, k) for float
    (clouds, n, features).

    Exact. In space each cloud is sorted into a grid; elsewhere, and on a GPU, all distances are asked. Of points that
    are equally far any may be taken.
    """
    found = points.detach()
    if found.device.type == "cpu" and found.shape[-1] == 3:
        return torch.from_numpy(_nearest_in_space(found.float().contiguous().numpy(), k)).long()
    # in bfloat16 points a hundredth apart are one
    with torch.autocast(found.device.type, enabled=False):
        found = found.float()
        squares = (found * found).sum(dim=-1)
        closeness = 2.0 * found @ found.transpose(1, 2) - squares[:, None, :]
        return closeness.topk(k, dim=-1).indices


def edge_maximum(features: Tensor, neighbors: Tensor) -> Tensor:
    """For each point the first half of its own features plus the greatest of each feature of the second half over its
    neighbours: float (clouds, n, width) of `features` (clouds, n, 2 width) and `neighbors` int64 (clouds, n, k)."""
    way = _EdgeMaximum if features.device.type == "cpu" else _EdgeMaximumAtOnce
    edges: Tensor = way.apply(features, neighbors)  # type: ignore[no-untyped-call]
    return edges


class _EdgeMaximum(torch.autograd.Function):
    """The gradient goes to the neighbour that was the greatest, the first of several."""

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
        _returned(incoming, ctx.chosen, outgoing)
        return torch.from_numpy(outgoing).to(gradient.dtype), None


class _EdgeMaximumAtOnce(torch.autograd.Function):
    """The same for a GPU, of tensors of all edges.

    A sum that many threads add to hangs on their order, unless its terms are whole numbers: gradients are rounded to
    a millionth of the greatest and added as such.
    """

    FINEST = 2**20
    """The greatest gradient in whole numbers: of up to 2,000 points at once it is within an int32."""

    @staticmethod
    def forward(ctx: Any, features: Tensor, neighbors: Tensor) -> Tensor:
        own, others = features.chunk(2, dim=-1)
        clouds = torch.arange(len(features), device=features.device)[:, None, None]
        greatest, place = others[clouds, neighbors].max(dim=2)
        ctx.save_for_backward(neighbors.gather(-1, place))
        return own + greatest

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, None]:
        (chosen,) = ctx.saved_tensors
        step = gradient.detach().float().abs().amax().clamp(min=1e-30) / _EdgeMaximumAtOnce.FINEST
        whole = (gradient.float() / step).round().to(torch.int32)
        with _any_order():
            sums = torch.zeros_like(whole).scatter_add_(1, chosen, whole)
        return torch.cat([gradient, (sums * step).to(gradient.dtype)], dim=-1), None


@contextmanager
def _any_order() -> Iterator[None]:
    """Whole numbers are added in whatever order, which is many times faster than one by one."""
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
def _returned(incoming, chosen, outgoing):
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
    found = np.empty((clouds, n, k), np.int32)
    for cloud in range(clouds):
        _nearest_of_cloud(points[cloud], k, found[cloud])
    return found


@numba.njit(cache=True)
def _nearest_of_cloud(points, k, found):
    """Rings of cells around a point are looked at until the k-th nearest is nearer than any cell that is left."""
    n = len(points)
    low = np.empty(3, np.float32)
    side = np.float32(0.0)
    for axis in range(3):
        low[axis] = points[:, axis].min()
        side = max(side, points[:, axis].max() - low[axis])
    # a surface passes through about 3 r^2 of r^3 cells
    r = min(max(int(np.sqrt(n / (3.0 * CELL_POINTS))), 1), 64)
    size = side / r if side > 0.0 else np.float32(1.0)
    cell = np.empty((n, 3), np.int32)
    first = np.zeros(r * r * r + 1, np.int32)
    for i in range(n):
        for axis in range(3):
            cell[i, axis] = min(int((points[i, axis] - low[axis]) / size), r - 1)
        first[(cell[i, 0] * r + cell[i, 1]) * r + cell[i, 2] + 1] += 1
    for place in range(r * r * r):
        first[place + 1] += first[place]
    filled = first[:-1].copy()
    order = np.empty(n, np.int32)
    sorted_points = np.empty((n, 3), np.float32)
    for i in range(n):
        place = (cell[i, 0] * r + cell[i, 1]) * r + cell[i, 2]
        order[filled[place]] = i
        for axis in range(3):
            sorted_points[filled[place], axis] = points[i, axis]
        filled[place] += 1
    near = np.empty(k, np.float32)
    which = np.empty(k, np.int32)
    for i in range(n):
        count = 0
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        cx, cy, cz = cell[i, 0], cell[i, 1], cell[i, 2]
        for ring in range(r):
            if count == k:
                # the nearest that a cell of this ring can be
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
                            place = (a * r + b) * r + c
                            for s in range(first[place], first[place + 1]):
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
            found[i, slot] = which[slot]
