"""How far variants are from their exemplars as one sees them: one bolt more or less moves next to no surface."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

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


class MovedSurface:
    """How far the surfaces of variants of a kit are from the nearest exemplar's; each variant is measured once.

    The distance of two surfaces is the mean over that of the variant, as a share of the exemplar's diagonal; boxes have
    a common centre. A part has the same points in all shapes, so that parts that stay add nothing.
    """

    def __init__(self, kit: Kit) -> None:
        self._kit = kit
        self._known: dict[int, tuple[Assembly, float]] = {}

    def distance(self, variants: Sequence[Assembly]) -> float:
        """Return the median distance of the variants, 0 for none."""
        distances = [self._of(variant) for variant in variants]
        return float(np.median(distances)) if distances else 0.0

    def _of(self, variant: Assembly) -> float:
        if id(variant) not in self._known:
            placed, weights = _placed(self._kit, self._points, variant)
            shares = [
                np.average(tree.query(placed)[0], weights=weights) / max(diagonal, 1e-300)
                for tree, diagonal in self._trees
            ]
            self._known[id(variant)] = variant, float(min(shares))
        return self._known[id(variant)][1]

    @cached_property
    def _points(self) -> list[FloatArray]:
        """Points on each type, float64 (p, 3)."""
        types = self._kit.types
        largest = max(float(sum(types[kind].area for kind in shown.types.tolist())) for shown in _exemplars(self._kit))
        points = []
        for index, kind in enumerate(types):
            count = max(round(POINTS_PER_EXEMPLAR * kind.area / max(largest, 1e-300)), 1)
            rng = decision_rng(0, RANDOM_STREAM, "moved", str(index))
            drawn = sample_surface(kind.vertices, kind.faces, count, rng)[0] if kind.area > 0 else kind.vertices[:0]
            points.append(drawn)
        return points

    @cached_property
    def _trees(self) -> list[tuple[cKDTree, float]]:
        """The points of each exemplar as a tree, and its diagonal."""
        trees = [cKDTree(_placed(self._kit, self._points, shown)[0]) for shown in _exemplars(self._kit)]
        return [(tree, float(np.linalg.norm(np.ptp(tree.data, axis=0)))) for tree in trees]


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
