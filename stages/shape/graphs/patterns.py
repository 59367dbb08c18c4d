"""The local patterns of a kit: poses observed around its parts, modulo their symmetries (strings §3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.docking import DockingTable
from stages.shape.geometry.pose import invert
from stages.shape.kit import Kit, PartType

MAX_UP_DIFFERENCE = 0.02
"""Up directions that differ by less, as unit vectors, are one."""


@dataclass(frozen=True, eq=False)
class Pattern:
    """What surrounds a part of type `part_type`, in its coordinates.

    types: types of the neighbours, ordered by type and docking, int64 (n,)
    poses: their poses, float64 (n, 4, 4)
    up: direction that was up, float64 (3,)
    seen: how often the pattern was observed
    owner: first exemplar that shows it
    """

    part_type: int
    types: np.ndarray
    poses: FloatArray
    up: FloatArray
    seen: float
    owner: int


def observed_patterns(kit: Kit, dockings: DockingTable, upright: bool) -> list[Pattern]:
    """Return the patterns of all parts of the exemplars, each once, in the order of their types.

    dockings: those of the kit
    upright: whether patterns that differ only in which way is up are two
    """
    axis = {"y": 1, "z": 2}[kit.up]
    patterns: dict[tuple[int, ...], list[Pattern]] = {}
    for number, exemplar in enumerate(kit.exemplars):
        assembly = exemplar.assembly
        labels = dockings.label_edges(assembly.types, assembly.poses, assembly.edges)
        tails = np.concatenate([assembly.edges[:, 0], assembly.edges[:, 1]])
        heads = np.concatenate([assembly.edges[:, 1], assembly.edges[:, 0]])
        seen_from = np.concatenate([labels[:, 0], labels[:, 1]])
        order = np.lexsort((heads, seen_from, assembly.types[heads], tails))
        starts = np.searchsorted(tails[order], np.arange(len(assembly) + 1))
        inverses = invert(assembly.poses)
        for part in range(len(assembly)):
            rows = order[starts[part] : starts[part + 1]]
            around = heads[rows]
            types = assembly.types[around].astype(np.int64)
            signature = (int(assembly.types[part]), *types.tolist(), *seen_from[rows].tolist())
            pattern = Pattern(
                int(assembly.types[part]),
                types,
                inverses[part] @ assembly.poses[around],
                np.ascontiguousarray(assembly.poses[part][axis, :3]),
                1,
                number,
            )
            alike = patterns.setdefault(signature, [])
            for index, known in enumerate(alike):
                if _same(kit, known, pattern, upright):
                    alike[index] = replace(known, seen=known.seen + 1)
                    break
            else:
                alike.append(pattern)
    return sorted((pattern for alike in patterns.values() for pattern in alike), key=lambda pattern: pattern.part_type)


def _same(kit: Kit, first: Pattern, second: Pattern, upright: bool) -> bool:
    """Return whether one pattern is the other, turned by a symmetry of the part in the middle."""
    turns = kit.types[first.part_type].symmetries[:, :3, :3]
    if upright:
        turns = turns[np.linalg.norm(turns @ first.up - second.up, axis=1) < MAX_UP_DIFFERENCE]
    limit = 2.0 * kit.pose_tolerance
    for turn in turns:
        positions = first.poses[:, :3, 3] @ turn.T
        gaps = np.linalg.norm(positions[:, None] - second.poses[None, :, :3, 3], axis=2)
        gaps[first.types[:, None] != second.types[None]] = np.inf
        nearest = gaps.argmin(axis=1) if len(gaps) else np.empty(0, dtype=np.int64)
        if len(set(nearest.tolist())) < len(nearest) or (gaps[np.arange(len(gaps)), nearest] > limit).any():
            continue
        if all(
            _looks_same(kit.types[kind], turn @ pose[:3, :3], second.poses[at][:3, :3], limit)
            for kind, pose, at in zip(first.types.tolist(), first.poses, nearest.tolist(), strict=True)
        ):
            return True
    return False


def _looks_same(part_type: PartType, rotation: FloatArray, other: FloatArray, limit: float) -> bool:
    gaps = part_type.symmetries[:, :3, :3] - other.T @ rotation
    return bool(np.linalg.norm(gaps.reshape(-1, 9), axis=1).min() * part_type.diagonal / 2 <= limit)


def unique_pattern_share(patterns: Sequence[Pattern]) -> float:
    """Return the share of exemplar parts whose pattern no other part shows: it predicts how much growth copies."""
    total = sum(pattern.seen for pattern in patterns)
    return sum(pattern.seen == 1 for pattern in patterns) / total
