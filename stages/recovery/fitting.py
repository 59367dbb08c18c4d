"""An input laid on the shapes of one program: which way up it stands, and whether it is whole or torn."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Literal

import numpy as np

from stages.programs.program import Program
from stages.recovery.partial_target import PartialTarget, partial_target
from stages.recovery.reading import RecoveryInput
from stages.recovery.refinement import RefinedShape, refine
from stages.recovery.targets import CloudTarget, DrawingTarget, RecoveryTarget, cloud_target, drawing_target
from stages.shape.arrays import FloatArray
from stages.shape.views.camera import Camera
from stages.sketches.settings import SketchesConfig
from stages.training.recovery.clouds import Frame, frame_of
from stages.training.recovery.estimate import ParameterEstimate, base_estimate
from stages.training.recovery.trained import TrainedRecovery

Up = Literal["x", "y", "z", ""]

WELL = 1.5
"""A whole shape that is no farther from a cloud than so many times as a cloud of it itself explains all of it, whatever
a network says that has learnt little."""
UNSURE, TORN = 2.0, 4.0
"""A cloud that is so many times farther from a guess, or from the best whole shape, than a cloud of that shape itself
may be torn."""
BETTER, EXPLAINED = 0.75, 0.25
"""It is, if a part of the guess, or of the best shape of which it may be one, is missing and leaves no more than
this share of the distance, and"""
LEAST_MISSING, MOST_MISSING = 0.15, 0.75
"""so much of the shape at least, and at most: with longer legs any table goes on below the ground, and a stick lies on
every chair."""
PRIOR = 0.01
"""The share of the distance that a nat of surprise costs in the search for what a torn cloud is a part of: of what is
not seen only the network knows anything."""
BY_CHANCE = 1.3
"""In that search what is nearer than so many times the distance of a cloud of the shape itself is no better."""

_UPRIGHT: Mapping[str, FloatArray] = {
    "y": np.eye(3),
    "z": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
    "x": np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
}
_QUARTER = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
"""A quarter turn about the axis that points up."""


@dataclass(frozen=True)
class InitialEstimate:
    """A program, what is guessed of the input, and the input as it stands upright, turned by `rotation` (3, 3). frame:
    the box around it then; none of a drawing."""

    program: Program
    model: TrainedRecovery | None
    estimate: ParameterEstimate
    target: RecoveryTarget
    rotation: FloatArray
    up: str
    frame: Frame | None


def initial_estimate(
    program: Program,
    model: TrainedRecovery | None,
    given: RecoveryInput,
    up: Up,
    turned: bool,
    seed: int,
    target_of: Callable[[FloatArray, np.random.Generator], RecoveryTarget] = cloud_target,
) -> InitialEstimate:
    """The best guess over the axes that may point up and the ways that a front may look."""
    if given.points is None:
        assert given.ink is not None
        config = SketchesConfig() if model is None else model.sketches
        guess = base_estimate(program) if model is None else model.estimate_from_drawing(given.ink)
        return InitialEstimate(program, model, guess, drawing_target(program, config, given.ink), np.eye(3), "y", None)
    looks = []
    for axis, rotation in _rotations(up, 4 if turned else 1):
        cloud = given.points @ rotation.T
        rng = np.random.default_rng(seed)
        guess = base_estimate(program) if model is None else model.estimate_from_cloud(cloud, rng)
        look = InitialEstimate(program, model, guess, target_of(cloud, rng), rotation, axis, frame_of(cloud))
        looks.append((refine(program, guess, look.target, 1, rng).distance, look))
    return min(looks, key=lambda each: each[0])[1]


def _rotations(up: Up, quarters: int) -> Iterator[tuple[str, FloatArray]]:
    for axis in [up] if up else ["y", "z", "x"]:
        rotation = _UPRIGHT[axis]
        for _ in range(quarters):
            yield axis, rotation
            rotation = _QUARTER @ rotation


@dataclass(frozen=True)
class RecoveryFit:
    """What a search has found for a look. floor: how far a cloud or drawing of that shape itself is from it; base: how
    far the program's base shape is; missing: the share of the shape that a torn cloud says nothing of; tried: shapes
    that were made until it was found."""

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
        """From the program's coordinates to the box that targets are compared in, to the upright input, to the input;
        float64 (4, 4)."""
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
        """From where a drawing is seen; None of a cloud."""
        target = self.refined.target
        return target.camera if isinstance(target, DrawingTarget) else None


def best_fit(look: InitialEstimate, given: RecoveryInput, up: Up, turned: bool, budget: int, seed: int) -> RecoveryFit:
    """The nearest whole shape; or, of a torn cloud, that of which the cloud may be a part.

    Networks learn from torn clouds, too, and guess the whole shape. Where a cloud lies much better on a part of that
    shape than on all of it, it is torn, unless a whole shape explains all of it. Where no network says so, it is if
    the best part explains it much better than the best whole shape.
    """
    if given.points is None or budget == 1:
        return _fit(look, budget, seed)
    partial = cache(lambda: initial_estimate(look.program, look.model, given, up, turned, seed, partial_target))
    told = False
    if look.model is not None:
        guess = _fit(look, 1, seed)
        part = _fit(partial(), 1, seed) if guess.distance > UNSURE * guess.floor else None
        if part is None or part.missing < LEAST_MISSING:
            return _fit(look, budget, seed)
        told = _is_part(part, guess, BETTER)
    whole = _fit(look, budget, seed)
    if whole.distance <= (WELL if told else TORN) * whole.floor:
        return whole
    torn = _fit(partial(), budget, seed)
    is_torn = LEAST_MISSING <= torn.missing <= MOST_MISSING if told else _is_part(torn, whole, EXPLAINED)
    return replace(torn if is_torn else whole, tried=whole.tried + torn.tried)


def _is_part(torn: RecoveryFit, whole: RecoveryFit, share: float) -> bool:
    """Whether a part that is missing leaves no more than a share of the distance."""
    return LEAST_MISSING <= torn.missing <= MOST_MISSING and torn.distance <= share * whole.distance


def _fit(look: InitialEstimate, budget: int, seed: int) -> RecoveryFit:
    rng = np.random.default_rng(seed)
    prior = near = 0.0
    if budget > 1 and look.model is not None and isinstance(look.target, PartialTarget):
        prior, near = PRIOR, BY_CHANCE * _fit(look, 1, seed).floor
    refined = refine(look.program, look.estimate, look.target, budget, rng, prior, near)
    base = refine(look.program, base_estimate(look.program), look.target, 1, rng).distance
    parts = look.program.parts(refined.values)
    missing = refined.target.missing(parts) if isinstance(refined.target, PartialTarget) else 0.0
    return RecoveryFit(look, refined, refined.target.floor(parts, rng), base, missing, refined.tried)
