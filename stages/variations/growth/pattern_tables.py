"""The patterns that growth may use, as tables for its kernels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stages.shape.graphs.patterns import Pattern
from stages.shape.kit import Kit
from stages.variations.growth.state import PatternTables


def pattern_tables(kit: Kit, patterns: Sequence[Pattern]) -> PatternTables:
    """Patterns, ordered by type, for the kernels."""
    poses = np.concatenate([np.empty((0, 4, 4)), *(each.poses for each in patterns)])
    parts = np.bincount(np.concatenate([each.assembly.types for each in kit.exemplars]), minlength=len(kit.types))
    return PatternTables(
        of_type=np.searchsorted([each.part_type for each in patterns], np.arange(len(kit.types) + 1)),
        starts=np.cumsum([0, *(len(each.types) for each in patterns)]),
        weights=np.array([float(each.seen) for each in patterns]),
        owners=np.array([each.owner for each in patterns], dtype=np.int64),
        ups=np.array([each.up for each in patterns]).reshape(-1, 3),
        types=np.concatenate([np.empty(0, dtype=np.int64), *(each.types for each in patterns)]),
        rotations=np.ascontiguousarray(poses[:, :3, :3]),
        translations=np.ascontiguousarray(poses[:, :3, 3]),
        shares=parts / parts.sum(),
    )
