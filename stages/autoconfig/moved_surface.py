"""How far variants are from their exemplars as one sees them: one bolt more or less moves next to no surface."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from pipeline.randomness import decision_rng
from stages.autoconfig.settings import RANDOM_STREAM
from stages.points.area_sampling import sample_surface
from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose import transform_points
from stages.shape.kit import Assembly, Kit

POINTS_PER_EXEMPLAR = 2000
"""Points on an exemplar; a part has at least one."""


def moved_distance(kit: Kit, variants: Sequence[Assembly]) -> float:
    """Return how far the surfaces of variants are from the nearest exemplar's: the median over the variants.

    The distance of two surfaces is the mean over that of the variant, as a share of the exemplar's diagonal; boxes have
    a common centre. A part has the same points in all shapes, so that parts that stay add nothing. 0 for no variants.
    """
    largest = max(float(sum(kit.types[kind].area for kind in shown.types.tolist())) for shown in _exemplars(kit))
    points = []
    for index, kind in enumerate(kit.types):
        count = max(round(POINTS_PER_EXEMPLAR * kind.area / max(largest, 1e-300)), 1)
        rng = decision_rng(0, RANDOM_STREAM, "moved", str(index))
        drawn = sample_surface(kind.vertices, kind.faces, count, rng)[0] if kind.area > 0 else kind.vertices[:0]
        points.append(drawn)
    trees = [cKDTree(placed) for placed, _ in (_placed(kit, points, shown) for shown in _exemplars(kit))]
    diagonals = [float(np.linalg.norm(np.ptp(tree.data, axis=0))) for tree in trees]
    distances = []
    for variant in variants:
        placed, weights = _placed(kit, points, variant)
        shares = [
            np.average(tree.query(placed)[0], weights=weights) / max(diagonal, 1e-300)
            for tree, diagonal in zip(trees, diagonals, strict=True)
        ]
        distances.append(float(min(shares)))
    return float(np.median(distances)) if distances else 0.0


def _exemplars(kit: Kit) -> list[Assembly]:
    return [exemplar.assembly for exemplar in kit.exemplars]


def _placed(kit: Kit, points: Sequence[FloatArray], shown: Assembly) -> tuple[FloatArray, FloatArray]:
    """Return points on a shape around its centre, float64 (n, 3), and the area that each stands for, float64 (n,)."""
    kinds = shown.types.tolist()
    placed = np.concatenate(
        [transform_points(pose, points[kind]) for kind, pose in zip(kinds, shown.poses, strict=True)]
    )
    areas = [np.full(len(points[kind]), kit.types[kind].area / max(len(points[kind]), 1)) for kind in kinds]
    return placed - (placed.min(axis=0) + placed.max(axis=0)) / 2, np.concatenate(areas)
