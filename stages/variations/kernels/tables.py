"""A kit and its shapes as the arrays that the kernels take."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import IntArray
from stages.shape.graphs.neighbourhoods import STRICTNESS
from stages.shape.kit import Assembly, Grammar, Kit
from stages.variations.kernels.structs import KitTables, NeighbourhoodRules, ShapeTables, Workspace

QUANTUM = 1 / 64
"""Step of the poses by which contact answers are looked up, as a share of the contact tolerance."""


def kit_tables(kit: Kit, upright: bool) -> KitTables:
    """The kit for the kernels.

    With `upright` a docking motion may rotate a piece about the vertical only.
    """
    bounds = np.stack([each.bounds for each in kit.types])
    weights = multiset_weights(len(kit.labels))
    return KitTables(
        symmetry_starts=np.cumsum([0, *(len(each.symmetries) for each in kit.types)]),
        symmetries=np.concatenate([each.symmetries[:, :3, :3] for each in kit.types]),
        boxes=np.ascontiguousarray(np.stack([bounds.mean(axis=1), (bounds[:, 1] - bounds[:, 0]) / 2], axis=1)),
        reach=np.array([each.diagonal / 2 for each in kit.types]),
        weights=weights[kit.label_of],
        label_of=kit.label_of.astype(np.int64),
        rules=_rules(kit.grammar, weights),
        limits=np.array([kit.pose_tolerance, kit.contact_tolerance, kit.contact_tolerance * QUANTUM]),
        up={"y": 1, "z": 2}[kit.up] if upright else -1,
    )


def multiset_weights(types: int) -> np.ndarray:
    """A weight for each of so many types, uint64 (types,): the sum over some parts is a hash of their types."""
    return np.random.Generator(np.random.PCG64(types)).integers(1, 2**63, types, dtype=np.uint64)


def _rules(grammar: Grammar, weights: np.ndarray) -> NeighbourhoodRules:
    """The neighbourhoods that `grammar` admits, for the kernels; weights: uint64 (labels,)."""
    types = len(weights)
    observed = {part_type: list(each) for part_type, each in grammar.neighbourhoods.items()}
    sizes = {(part_type, sum(count for _, count in each)) for part_type, seen in observed.items() for each in seen}
    has_size = np.zeros((types, 1 + max(size for _, size in sizes)), dtype=np.bool_)
    has_size[tuple(np.array(sorted(sizes)).T)] = True
    set_weights = np.random.Generator(np.random.PCG64(types + 1)).integers(1, 2**63, types, dtype=np.uint64)
    sets, known = set(), []
    local = np.full((types, types), -1, dtype=np.int32)
    squares = np.zeros(types + 1, dtype=np.int64)
    for part_type, seen in observed.items():
        around = sorted({other for each in seen for other, _ in each})
        local[part_type, around] = np.arange(len(around))
        squares[part_type + 1] = len(around) ** 2
        for each in seen:
            size = sum(count for _, count in each)
            key = _mix((part_type * 0x9E3779B97F4A7C15 + size) % 2**64)
            sets.add((key + sum(int(set_weights[other]) for other, _ in each)) % 2**64)
            total = _mix(int(weights[part_type])) + sum(int(weights[other]) * count for other, count in each)
            known.append(total % 2**64)
    starts = squares.cumsum()
    pairs = np.zeros(starts[-1], dtype=np.bool_)
    for part_type, seen in observed.items():
        side = round(float(squares[part_type + 1]) ** 0.5)
        for each in seen:
            rows = local[part_type, [other for other, _ in each]]
            pairs[starts[part_type] + (rows[:, None] * side + rows[None, :]).ravel()] = True
    # Every observed neighbourhood is admitted at every level.
    room = 1 << max(16, (4 * len(known)).bit_length())
    keys, verdicts = np.zeros(room, dtype=np.uint64), np.zeros(room, dtype=np.int64)
    for key in known:
        slot = key % room
        while keys[slot] != 0:
            slot = (slot + 1) % room
        keys[slot], verdicts[slot] = key, 1
    return NeighbourhoodRules(
        level=STRICTNESS.index(grammar.strictness) if grammar.strictness in STRICTNESS else len(STRICTNESS),
        keys=keys,
        verdicts=verdicts,
        filled=np.array([len(known)]),
        sizes=has_size,
        set_weights=set_weights,
        sets=np.array(sorted(sets), dtype=np.uint64),
        local=local,
        pair_starts=starts[:-1].copy(),
        pairs=pairs,
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
        rotations=np.ascontiguousarray(assembly.poses[:, :3, :3]),
        translations=np.ascontiguousarray(assembly.poses[:, :3, 3]),
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
        rotations=np.zeros((2 * largest, 3, 3)),
        translations=np.zeros((2 * largest, 3)),
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
