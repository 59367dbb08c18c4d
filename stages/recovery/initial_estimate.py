"""The initial estimate: which axis of an input points up, where its front looks, and likely parameters."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from stages.programs.program import Program
from stages.recovery.cloud_target import cloud_target
from stages.recovery.drawing_target import drawing_target
from stages.recovery.inputs import RecoveryInput
from stages.recovery.refinement import refine_estimate
from stages.recovery.target import RecoveryTarget
from stages.shape.arrays import FloatArray
from stages.sketches.settings import SketchesConfig
from stages.training.recovery.clouds import Frame, frame_of
from stages.training.recovery.estimate import ParameterEstimate, base_estimate
from stages.training.recovery.trained import TrainedRecovery

Up = Literal["x", "y", "z", ""]
"""The axis of a cloud that points up; empty: the best of the three."""

_UPRIGHT: Mapping[str, FloatArray] = {
    "y": np.eye(3),
    "z": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
    "x": np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
}
_QUARTER_TURN = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
"""About the axis that points up."""


@dataclass(frozen=True)
class InitialEstimate:
    """A program, and how an input is turned and described before the search.

    model: the network that the estimate comes from; None without a network
    estimate: probabilities of the parameters
    target: the input upright
    rotation: float64 (3, 3), turns the input upright
    up: the axis of the input that points up
    frame: the box around the upright input; None for a drawing
    """

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
    source: RecoveryInput,
    up: Up,
    turned: bool,
    seed: int,
    target_of: Callable[[FloatArray, np.random.Generator], RecoveryTarget] = cloud_target,
) -> InitialEstimate:
    """Make the best estimate over the axes that may point up and, where `turned`, four directions of the front."""
    if source.points is None:
        assert source.ink is not None
        config = SketchesConfig() if model is None else model.sketches
        estimate = base_estimate(program) if model is None else model.estimate_from_drawing(source.ink)
        target = drawing_target(program, config, source.ink)
        return InitialEstimate(program, model, estimate, target, np.eye(3), "y", None)
    candidates = []
    for axis, rotation in _rotations(up, 4 if turned else 1):
        cloud = source.points @ rotation.T
        rng = np.random.default_rng(seed)
        estimate = base_estimate(program) if model is None else model.estimate_from_cloud(cloud, rng)
        initial = InitialEstimate(program, model, estimate, target_of(cloud, rng), rotation, axis, frame_of(cloud))
        candidates.append((refine_estimate(program, estimate, initial.target, 1, rng).distance, initial))
    return min(candidates, key=lambda candidate: candidate[0])[1]


def _rotations(up: Up, quarters: int) -> Iterator[tuple[str, FloatArray]]:
    for axis in [up] if up else ["y", "z", "x"]:
        rotation = _UPRIGHT[axis]
        for _ in range(quarters):
            yield axis, rotation
            rotation = _QUARTER_TURN @ rotation
