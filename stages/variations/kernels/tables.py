"""A kit and its shapes as the arrays that compiled code takes."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.contact_lookup import POSE_QUANTUM
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.graphs.grammar_patterns import grammar_patterns
from stages.shape.kit import Assembly, Grammar, Kit
from stages.variations.kernels.structs import N_UNKNOWNS, KitTables, NeighbourhoodRules, ShapeTables, Workspace


def kit_tables(kit: Kit, upright: bool, shares: FloatArray | None = None) -> KitTables:
    """Return the tables of a kit.

    upright: whether docking transforms rotate pieces about the vertical only
    shares: smallest and largest share of the parts that each label may have, float64 (labels, 2); None: any
    """
    bounds = np.stack([part_type.bounds for part_type in kit.types])
    weights = multiset_weights(len(kit.labels))
    return KitTables(
        symmetry_starts=np.cumsum([0, *(len(part_type.symmetries) for part_type in kit.types)]),
        symmetries=np.concatenate([part_type.symmetries[:, :3, :3] for part_type in kit.types]),
        boxes=np.ascontiguousarray(np.stack([bounds.mean(axis=1), (bounds[:, 1] - bounds[:, 0]) / 2], axis=1)),
        reach=np.array([part_type.diagonal / 2 for part_type in kit.types]),
        weights=weights[kit.label_of],
        label_of=kit.label_of.astype(np.int64),
        rules=_rules(kit.grammar, weights),
        limits=np.array([kit.pose_tolerance, kit.contact_tolerance, kit.contact_tolerance * POSE_QUANTUM]),
        up={"y": 1, "z": 2}[kit.up] if upright else -1,
        shares=np.tile([0.0, np.inf], (len(kit.labels), 1)) if shares is None else shares,
    )


def multiset_weights(types: int) -> np.ndarray:
    """Return a weight for each of `types` types, uint64 (types,): the sum over parts is a hash of their types."""
    return np.random.Generator(np.random.PCG64(types)).integers(1, 2**63, types, dtype=np.uint64)


def _rules(grammar: Grammar, weights: np.ndarray) -> NeighbourhoodRules:
    """Return the neighbourhoods that `grammar` admits. weights: uint64 (labels,)"""
    known = [
        (_mix(int(weights[part_type])) + sum(int(weights[other]) * count for other, count in near)) % 2**64
        for part_type, observed in grammar.neighbourhoods.items()
        for near in observed
    ]
    room = 1 << max(16, (4 * len(known)).bit_length())
    keys, verdicts = np.zeros(room, dtype=np.uint64), np.zeros(room, dtype=np.int64)
    for key in known:
        slot = key % room
        while keys[slot] != 0:
            slot = (slot + 1) % room
        keys[slot], verdicts[slot] = key, 1  # every observed neighbourhood is admitted at every level
    return NeighbourhoodRules(
        patterns=grammar_patterns(grammar, len(weights)),
        is_exact=grammar.strictness == "multiset",
        keys=keys,
        verdicts=verdicts,
        filled=np.array([len(known)]),
    )


def _mix(x: int) -> int:
    """Return what `hash_tables.mix` returns, in Python."""
    x = ((x ^ (x >> 30)) * 0xBF58476D1CE4E5B9) % 2**64
    x = ((x ^ (x >> 27)) * 0x94D049BB133111EB) % 2**64
    return x ^ (x >> 31)


def shape_tables(assembly: Assembly, labels: IntArray, types: int) -> ShapeTables:
    """Return the tables of an assembly with directed docking labels int32 (m, 2); the kit has `types` types."""
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


def workspace(max_parts: int) -> Workspace:
    """Return room for variants of at most `max_parts` parts."""
    return Workspace(
        inside=np.zeros(max_parts, dtype=np.bool_),
        boundary=np.zeros(max_parts, dtype=np.int64),
        images=np.zeros(max_parts, dtype=np.int64),
        image_of=np.zeros(max_parts, dtype=np.int64),
        component=np.zeros(max_parts, dtype=np.int64),
        keep=np.zeros(max_parts, dtype=np.bool_),
        stack=np.zeros(64 * max_parts, dtype=np.int64),
        transform=np.zeros((4, 3)),
        from_a=np.zeros(max_parts, dtype=np.int64),
        from_b=np.zeros(max_parts, dtype=np.int64),
        types=np.zeros(2 * max_parts, dtype=np.int64),
        rotations=np.zeros((2 * max_parts, 3, 3)),
        translations=np.zeros((2 * max_parts, 3)),
        origin=np.zeros(2 * max_parts, dtype=np.int64),
        stamp=np.zeros((2 * max_parts, 2 * max_parts), dtype=np.int64),
        label=np.zeros((2 * max_parts, 2 * max_parts), dtype=np.int64),
        edges=np.zeros((64 * max_parts, 2), dtype=np.int64),
        unknown=np.zeros((1024, 2), dtype=np.int64),
        colour=np.zeros(2 * max_parts, dtype=np.uint64),
        fresh=np.zeros(2 * max_parts, dtype=np.uint64),
        boxes=np.zeros((2 * max_parts, 2, 3)),
        near=np.zeros((256 * max_parts, 2), dtype=np.int64),
        counts=np.zeros(8, dtype=np.int64),
    )


def resolve_unknown(oracle: ContactOracle, ws: Workspace) -> bool:
    """Let the oracle learn the contacts listed in `ws.unknown`; return False as soon as one is FORBIDDEN_CONTACT."""
    return oracle.resolve(ws.types, ws.rotations, ws.translations, ws.unknown[: ws.counts[N_UNKNOWNS]])
