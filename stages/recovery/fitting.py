"""Fit one program to an input, whether the input is whole or partial."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from stages.recovery.cloud_target import CloudTarget
from stages.recovery.drawing_target import DrawingTarget
from stages.recovery.initial_estimate import InitialEstimate, Up, initial_estimate
from stages.recovery.inputs import RecoveryInput
from stages.recovery.partial_target import PartialTarget, partial_target
from stages.recovery.refinement import RefinedShape, refine_estimate
from stages.shape.arrays import FloatArray
from stages.shape.views.camera import Camera
from stages.training.recovery.estimate import base_estimate

MAX_WHOLE_DISTANCE = 1.5
"""A whole shape this near explains all of a cloud, in distances of a cloud of the shape itself (floors). This corrects
a network that has learnt little."""
MIN_ESTIMATE_DISTANCE, MIN_PARTIAL_DISTANCE = 2.0, 4.0
"""A cloud may be partial from this distance of the initial estimate, or of the best whole shape, on; in floors."""
MAX_ESTIMATE_RATIO, MAX_PARTIAL_RATIO = 0.75, 0.25
"""A cloud is partial if the best partial shape has at most this share of the whole shape's distance: of the initial
estimates, or of the results of both searches."""
MIN_MISSING_SHARE, MAX_MISSING_SHARE = 0.15, 0.75
"""With longer legs any table goes on below the ground, and a stick fits every chair."""
SURPRISE_COST = 0.01
"""Cost of a nat of surprise as a share of the distance, in the search for partial scans: only the network knows about
what is not seen."""
CHANCE_DISTANCE = 1.3
"""In that search, distances below this many floors do not differ."""


@dataclass(frozen=True)
class RecoveryFit:
    """The result of one search.

    initial: where the search began
    refined: the shape that was found
    floor: distance of a cloud or drawing of that shape itself
    base: distance of the program's base shape
    missing: share of the shape beyond the edge of a partial cloud
    tried: shapes that were built
    """

    initial: InitialEstimate
    refined: RefinedShape
    floor: float
    base: float
    missing: float
    tried: int

    @property
    def distance(self) -> float:
        return self.refined.distance

    @property
    def placement(self) -> FloatArray | None:
        """The matrix from the program's coordinates to the input's, float64 (4, 4); None for a drawing."""
        target = self.refined.target
        if self.initial.frame is None or not isinstance(target, CloudTarget | PartialTarget):
            return None
        outer, inner = self.initial.frame, target.frame
        scale = outer.size / inner.size
        matrix = np.eye(4)
        matrix[:3, :3] = self.initial.rotation.T * scale
        matrix[:3, 3] = self.initial.rotation.T @ (outer.centre - inner.centre * scale)
        return matrix

    @property
    def camera(self) -> Camera | None:
        """The camera of a drawing; None for a cloud."""
        target = self.refined.target
        return target.camera if isinstance(target, DrawingTarget) else None


def best_fit(
    initial: InitialEstimate, source: RecoveryInput, up: Up, turned: bool, budget: int, seed: int
) -> RecoveryFit:
    """Find the nearest whole shape or, for a partial cloud, the nearest shape that it may be a part of.

    Networks learn from partial clouds too, and estimate the whole shape. A cloud is partial where it fits much better
    to a part of that estimate than to the whole, unless a whole shape explains all of it. Where the network does not
    tell, the results of both searches decide.
    """
    if source.points is None or budget == 1:
        return _fit(initial, budget, seed)
    partial = cache(lambda: initial_estimate(initial.program, initial.model, source, up, turned, seed, partial_target))
    looks_partial = False
    if initial.model is not None:
        estimate = _fit(initial, 1, seed)
        part = _fit(partial(), 1, seed) if estimate.distance > MIN_ESTIMATE_DISTANCE * estimate.floor else None
        if part is None or part.missing < MIN_MISSING_SHARE:
            return _fit(initial, budget, seed)
        looks_partial = _is_partial(part, estimate, MAX_ESTIMATE_RATIO)
    whole = _fit(initial, budget, seed)
    if whole.distance <= (MAX_WHOLE_DISTANCE if looks_partial else MIN_PARTIAL_DISTANCE) * whole.floor:
        return whole
    part = _fit(partial(), budget, seed)
    if looks_partial:
        is_partial = MIN_MISSING_SHARE <= part.missing <= MAX_MISSING_SHARE
    else:
        is_partial = _is_partial(part, whole, MAX_PARTIAL_RATIO)
    return replace(part if is_partial else whole, tried=whole.tried + part.tried)


def _is_partial(part: RecoveryFit, whole: RecoveryFit, max_ratio: float) -> bool:
    in_range = MIN_MISSING_SHARE <= part.missing <= MAX_MISSING_SHARE
    return in_range and part.distance <= max_ratio * whole.distance


def _fit(initial: InitialEstimate, budget: int, seed: int) -> RecoveryFit:
    rng = np.random.default_rng(seed)
    program, surprise_cost, chance_distance = initial.program, 0.0, 0.0
    if budget > 1 and initial.model is not None and isinstance(initial.target, PartialTarget):
        surprise_cost, chance_distance = SURPRISE_COST, CHANCE_DISTANCE * _fit(initial, 1, seed).floor
    refined = refine_estimate(program, initial.estimate, initial.target, budget, rng, surprise_cost, chance_distance)
    base = refine_estimate(program, base_estimate(program), initial.target, 1, rng).distance
    parts = program.parts(refined.values)
    missing = refined.target.missing(parts) if isinstance(refined.target, PartialTarget) else 0.0
    return RecoveryFit(initial, refined, refined.target.floor(parts, rng), base, missing, refined.tried)
