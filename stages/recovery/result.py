"""The result of a recovery, and what casts doubt on it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from stages.programs.parameters import Value
from stages.programs.program import Program
from stages.recovery.fitting import RecoveryFit
from stages.shape.arrays import FloatArray
from stages.shape.views.camera import Camera

MAX_LIKE_DISTANCE = {"points": 0.004, "sketch": 0.001}
"""Above the floor; a shape at a larger distance is of another sort. Lines are everywhere in a drawing, so no lines are
far from them."""
MAX_BASE_RATIO = 0.9
"""A result with a larger share of the base shape's distance says nothing about the input."""


@dataclass(frozen=True)
class RecoveryResult:
    """The recovered parameters.

    program, values: what builds the shape
    distance: mean squared distance between input and shape, both ways added, in longest sides of the input's box (of
    a drawing: of its ink); of a partial cloud without the missing part
    base_distance: the same of the program's base shape
    missing: share of the shape's surface beyond the edge of a partial cloud, else 0
    confidence: probability that the network gives the value of each visible parameter; None without a network
    placement: float64 (4, 4), from the program's coordinates to the input's; None for a drawing
    camera: from where a drawing is seen; None for a cloud
    up: the axis of the input that points up
    tried: shapes that were built
    warnings: what casts doubt on the result
    """

    program: Program
    values: Mapping[str, Value]
    distance: float
    base_distance: float
    missing: float
    confidence: Mapping[str, float] | None
    placement: FloatArray | None
    camera: Camera | None
    up: str
    tried: int
    warnings: tuple[str, ...]

    def as_json(self) -> dict[str, Any]:
        """All of it as JSON; `parameters` is what `stages.programs make` reads."""
        values, visible = self.program.schema.canonical(self.values)
        return {
            "program": self.program.name,
            "parameters": {name: value for name, value in values.items() if name in visible},
            "chamfer": self.distance,
            "chamfer_of_base": self.base_distance,
            "partial": self.missing > 0.0,
            "missing": round(self.missing, 3),
            "confidence": dict(self.confidence) if self.confidence is not None else None,
            "placement": self.placement.tolist() if self.placement is not None else None,
            "camera": asdict(self.camera) if self.camera is not None else None,
            "up": self.up,
            "shapes_tried": self.tried,
            "warnings": list(self.warnings),
        }


def recovery_result(fit: RecoveryFit, kind: str, outliers: int, program_named: bool) -> RecoveryResult:
    """Make the result of a fit to an input of a kind, `points` or `sketch`, without its `outliers`."""
    warnings = tuple(_warnings(fit, kind, outliers, program_named))
    return RecoveryResult(
        fit.initial.program, fit.refined.values, fit.distance, fit.base, fit.missing, _confidence(fit), fit.placement,
        fit.camera, fit.initial.up, fit.tried, warnings,
    )  # fmt: skip


def _warnings(fit: RecoveryFit, kind: str, outliers: int, program_named: bool) -> list[str]:
    name, model = fit.initial.program.name, fit.initial.model
    warnings = []
    if not program_named:
        warnings.append(f"no program was named: {name} fits best")
    if model is None:
        warnings.append(f"there is no trained model of {name} for {kind}: searched from its base shape alone")
    if outliers:
        warnings.append(f"{outliers:,} points of the cloud are outliers and were left out")
    if fit.missing > 0.0:
        warnings.append(
            f"the cloud is partial: {fit.missing:.0%} of the recovered shape is beyond its edge, and the parameters "
            "there are guesses"
        )
    max_distance = MAX_LIKE_DISTANCE[kind]
    if model is not None and kind != "sketch":
        max_distance = min(max_distance, model.typical_distance)
    if fit.distance - fit.floor > max_distance:
        warnings.append(
            f"the input is unlike any {name}: the nearest has distance {fit.distance:.2g}, more than "
            f"{fit.floor + max_distance:.2g}"
        )
    if fit.distance - fit.floor > MAX_BASE_RATIO * (fit.base - fit.floor):
        warnings.append(f"the result is no better than the base shape of the program ({fit.base:.2g})")
    return warnings


def _confidence(fit: RecoveryFit) -> dict[str, float] | None:
    if fit.initial.model is None:
        return None
    program, values = fit.initial.program, fit.refined.values
    _, visible = program.schema.canonical(values)
    return {
        parameter.name: round(
            float(fit.initial.estimate.probabilities[parameter.name][parameter.class_of(values[parameter.name])]), 4
        )
        for parameter in program.parameters
        if parameter.name in visible
    }
