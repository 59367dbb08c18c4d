"""The patterns that growth may use, as tables for compiled code."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stages.shape.graphs.patterns import Pattern
from stages.shape.kit import Kit
from stages.variations.growth.state import PatternTables


def pattern_tables(kit: Kit, patterns: Sequence[Pattern]) -> PatternTables:
    """Return patterns, ordered by type, as tables."""
    poses = np.concatenate([np.empty((0, 4, 4)), *(pattern.poses for pattern in patterns)])
    types = np.concatenate([exemplar.assembly.types for exemplar in kit.exemplars])
    parts = np.bincount(types, minlength=len(kit.types))
    return PatternTables(
        of_type=np.searchsorted([pattern.part_type for pattern in patterns], np.arange(len(kit.types) + 1)),
        starts=np.cumsum([0, *(len(pattern.types) for pattern in patterns)]),
        weights=np.array([float(pattern.seen) for pattern in patterns]),
        owners=np.array([pattern.owner for pattern in patterns], dtype=np.int64),
        ups=np.array([pattern.up for pattern in patterns]).reshape(-1, 3),
        types=np.concatenate([np.empty(0, dtype=np.int64), *(pattern.types for pattern in patterns)]),
        rotations=np.ascontiguousarray(poses[:, :3, :3]),
        translations=np.ascontiguousarray(poses[:, :3, 3]),
        shares=parts / parts.sum(),
    )
