"""A kit and its shapes as the arrays that the kernels take."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import IntArray
from stages.shape.kit import Assembly, Kit
from stages.shape.neighbourhoods import enumerate_admitted
from stages.variations.kernels import KitTables, ShapeTables, Workspace

__all__ = ["QUANTUM", "kit_tables", "shape_tables", "workspace"]

QUANTUM = 1 / 64
"""Step of the poses by which contact answers are looked up, as a share of the contact tolerance."""


def kit_tables(kit: Kit, upright: bool) -> KitTables:
    """The kit for the kernels, with every neighbourhood that its grammar admits.

    With `upright` a docking motion may turn a piece about the vertical only.
    """
    bounds = np.stack([each.bounds for each in kit.types])
    weights = np.random.Generator(np.random.PCG64(len(kit.types))).integers(1, 2**63, len(kit.types), dtype=np.uint64)
    allowed = []
    weight_of = weights.tolist()
    for part_type, multiset in enumerate_admitted(kit.grammar):
        total = _mix(weight_of[part_type])
        for other, count in multiset:
            total += weight_of[other] * count
        allowed.append(total % 2**64)
    return KitTables(
        symmetry_starts=np.cumsum([0, *(len(each.symmetries) for each in kit.types)]),
        symmetries=np.concatenate([each.symmetries[:, :3, :3] for each in kit.types]),
        boxes=np.ascontiguousarray(np.stack([bounds.mean(axis=1), (bounds[:, 1] - bounds[:, 0]) / 2], axis=1)),
        reach=np.array([each.diagonal / 2 for each in kit.types]),
        weights=weights,
        allowed=np.unique(np.array(allowed, dtype=np.uint64)),
        limits=np.array([kit.pose_tolerance, kit.contact_tolerance, kit.contact_tolerance * QUANTUM]),
        up={"y": 1, "z": 2}[kit.up] if upright else -1,
    )


def _mix(x: int) -> int:
    """The kernels' mixing of one 64-bit word."""
    x = ((x ^ (x >> 30)) * 0xBF58476D1CE4E5B9) % 2**64
    x = ((x ^ (x >> 27)) * 0x94D049BB133111EB) % 2**64
    return x ^ (x >> 31)


def shape_tables(assembly: Assembly, labels: IntArray, types: int) -> ShapeTables:
    """An assembly with directed docking labels int32 (m, 2) for the kernels; the kit has `types` types."""
    n, edges = len(assembly), assembly.edges.astype(np.int64)
    tails = np.concatenate([edges[:, 0], edges[:, 1]])
    heads = np.concatenate([edges[:, 1], edges[:, 0]])
    order = np.lexsort((heads, tails))
    part_types = assembly.types.astype(np.int64)
    return ShapeTables(
        types=part_types,
        turns=np.ascontiguousarray(assembly.poses[:, :3, :3]),
        places=np.ascontiguousarray(assembly.poses[:, :3, 3]),
        starts=np.searchsorted(tails[order], np.arange(n + 1)),
        ends=heads[order],
        labels=np.concatenate([labels[:, 0], labels[:, 1]]).astype(np.int64)[order],
        type_starts=np.searchsorted(np.sort(part_types), np.arange(types + 1)),
        by_type=np.argsort(part_types, kind="stable"),
    )


def workspace(largest: int) -> Workspace:
    """Room for tries on shapes of at most `largest` parts."""
    return Workspace(
        inside=np.zeros(largest, dtype=np.bool_),
        boundary=np.zeros(largest, dtype=np.int64),
        images=np.zeros(largest, dtype=np.int64),
        image_of=np.zeros(largest, dtype=np.int64),
        component=np.zeros(largest, dtype=np.int64),
        keep=np.zeros(largest, dtype=np.bool_),
        stack=np.zeros(64 * largest, dtype=np.int64),
        motion=np.zeros((4, 3)),
        from_a=np.zeros(largest, dtype=np.int64),
        from_b=np.zeros(largest, dtype=np.int64),
        types=np.zeros(2 * largest, dtype=np.int64),
        turns=np.zeros((2 * largest, 3, 3)),
        places=np.zeros((2 * largest, 3)),
        origin=np.zeros(2 * largest, dtype=np.int64),
        stamp=np.zeros((2 * largest, 2 * largest), dtype=np.int64),
        label=np.zeros((2 * largest, 2 * largest), dtype=np.int64),
        edges=np.zeros((64 * largest, 2), dtype=np.int64),
        unknown=np.zeros((1024, 2), dtype=np.int64),
        colour=np.zeros(2 * largest, dtype=np.uint64),
        fresh=np.zeros(2 * largest, dtype=np.uint64),
        boxes=np.zeros((2 * largest, 2, 3)),
        near=np.zeros((256 * largest, 2), dtype=np.int64),
        counts=np.zeros(8, dtype=np.int64),
    )
