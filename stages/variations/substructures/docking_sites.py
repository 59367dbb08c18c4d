"""The cyclic order of the docking sites of each part, from the positions of its neighbours (substructures §4.3.2).

Parts are separate meshes, so no surface runs through a whole shape along which their borders could be followed. The
order is that of the neighbours' centroids, projected into the plane that fits them best. Of 753 parts of seven real
models, 23 have an open border along which all of three or more neighbours lie; in each the order along it is that of
the projection.
"""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.pose import invert
from stages.shape.kit import Assembly, Kit
from stages.variations.substructures.ordered_graph import OrderedGraph, ordered_graph

SAME_DIRECTION = 1e-3
"""Directions that differ by less, as a share of a radian or of a spread, are equal."""


def docking_graph(kit: Kit, assembly: Assembly, labels: IntArray) -> OrderedGraph:
    """Return the shape graph of an assembly with its docking sites in order.

    Nodes are of the kit's labels, not of its meshes; dockings count from 1.
    labels: int32 (m, 2), those of its edges
    """
    centroids = np.stack([kit.types[index].centroid for index in assembly.types])
    centroids = np.einsum("nij,nj->ni", assembly.poses[:, :3, :3], centroids) + assembly.poses[:, :3, 3]
    up = np.eye(3)[{"y": 1, "z": 2}[kit.up]]
    label_of: dict[tuple[int, int], int] = {}
    for (i, j), (forth, back) in zip(assembly.edges.tolist(), labels.tolist(), strict=True):
        label_of[i, j], label_of[j, i] = forth + 1, back + 1
    orders = []
    for part, near in enumerate(assembly.neighbours()):
        own = invert(assembly.poses[part])[:3, :3].T @ kit.types[assembly.types[part]].frame[:3, :3]
        order = cyclic_order(centroids[near] - centroids[part], np.stack([up, *own.T]))
        orders.append([near[index] for index in order])
    docked = [[label_of[part, other] for other in order] for part, order in enumerate(orders)]
    return ordered_graph(kit.label_of[assembly.types], orders, docked)


def contact_graph(kit: Kit, assembly: Assembly, labels: IntArray) -> OrderedGraph:
    """Return the same with docking sites in the order of the neighbours' numbers, where no cyclic order is needed."""
    tails, heads = np.concatenate([assembly.edges, assembly.edges[:, ::-1]]).T.astype(np.int64)
    order = np.lexsort((heads, tails))
    position = np.empty(len(order), dtype=np.int64)
    position[order] = np.arange(len(order))
    return OrderedGraph(
        types=kit.label_of[assembly.types].astype(np.int64),
        starts=np.searchsorted(tails[order], np.arange(len(assembly) + 1)),
        tails=tails[order],
        twins=position[(order + len(order) // 2) % max(len(order), 1)],
        labels=labels.T.reshape(-1)[order].astype(np.int64) + 1,
    )


def cyclic_order(sites: FloatArray, axes: FloatArray) -> list[int]:
    """Return the order of `sites` float64 (k, 3), seen from their part, counter-clockwise round the plane's normal.

    Sites in one direction go from the far side of the plane to the near one, then by distance; those over the part
    itself go first.
    axes: float64 (a, 3), directions that decide what the sites leave open, the most decisive first: the normal where
        they lie on a line or no plane fits best, and its side
    """
    if len(sites) < 3 or not sites.any():
        return list(range(len(sites)))
    normal = _normal(sites, axes)
    heights = sites @ normal
    flat = sites - heights[:, None] * normal
    reach = np.linalg.norm(flat, axis=1)
    if reach.max() <= SAME_DIRECTION * np.abs(heights).max():
        return [int(site) for site in np.argsort(heights, kind="stable")]
    first = _first(flat / reach.max(), heights, np.cross(axes, normal))
    angles = np.arctan2(flat @ np.cross(normal, first), flat @ first) % (2 * np.pi)
    steps = np.round(angles / SAME_DIRECTION) % round(2 * np.pi / SAME_DIRECTION)
    steps[reach <= SAME_DIRECTION * reach.max()] = -1
    return [int(site) for site in np.lexsort((reach, heights, steps))]


def _first(flat: FloatArray, heights: FloatArray, across: FloatArray) -> FloatArray:
    """Return the direction from which angles are counted, float64 (3,): that of the site farthest from the normal.

    Of equals it is the lowest, then the one farthest along the first of `across` that decides.
    """
    reach = np.linalg.norm(flat, axis=1)
    keys = [*(np.round(flat @ axis, 6) for axis in across[::-1]), heights.round(6), -reach.round(6)]
    first = flat[int(np.lexsort(keys)[0])]
    direction: FloatArray = first / np.linalg.norm(first)
    return direction


def _normal(sites: FloatArray, axes: FloatArray) -> FloatArray:
    """Return the normal of the best-fitting plane through the part, on a side that the sites or `axes` choose."""
    spreads, directions = np.linalg.eigh(np.cov(np.concatenate([np.zeros((1, 3)), sites]).T, bias=True))
    free = directions[:, spreads <= spreads[0] + SAME_DIRECTION * spreads[2]]
    # Of several equally good normals the first axis that is perpendicular to none of them chooses.
    for axis in axes:
        chosen = free @ (free.T @ axis)
        if np.linalg.norm(chosen) > SAME_DIRECTION:
            normal = chosen / np.linalg.norm(chosen)
            break
    else:
        normal = free[:, 0]
    leanings = [float(normal @ axes[0]), float(((sites @ normal) ** 3).sum() / np.abs(sites).max() ** 3)]
    leanings += [float(normal @ axis) for axis in axes[1:]]
    leaning = next((value for value in leanings if abs(value) > SAME_DIRECTION), 1.0)
    side: FloatArray = normal if leaning > 0 else -normal
    return side
