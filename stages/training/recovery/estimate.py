"""What is known of a shape before any is tried."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stages.programs.parameters import Parameter, Value
from stages.programs.program import Program
from stages.programs.schema import Values
from stages.shape.arrays import FloatArray

LEAST_CHANCE = 1e-4
"""No value is less likely to the network than this: it may be wrong."""


@dataclass(frozen=True)
class ParameterEstimate:
    """What is known before anything is tried. probabilities: of the values of each parameter, float64 (values,), by
    name, were it visible; start: the values where the search begins, the likeliest if there are none."""

    probabilities: dict[str, FloatArray]
    start: Values | None = None

    def values(self, program: Program) -> dict[str, Value]:
        """The value of each parameter where the search begins, whether it is visible or not."""
        if self.start is not None:
            return dict(self.start)
        likeliest = {name: int(each.argmax()) for name, each in self.probabilities.items()}
        return {each.name: each.values[likeliest[each.name]] for each in program.parameters}

    def certainty(self, name: str) -> float:
        """The probability of the likeliest value."""
        return float(self.probabilities[name].max())

    def surprise(self, program: Program, settled: Values) -> float:
        """How much less likely the visible ones of some values are than the likeliest, in nats; of continuous ones by
        the normal distribution that has the mean and the variance of the probabilities."""
        _, visible = program.schema.canonical(settled)
        shown = (each for each in program.parameters if each.name in visible)
        return sum(_surprise(each, self.probabilities[each.name], settled[each.name]) for each in shown)


def estimate_from_probabilities(program: Program, chances: FloatArray) -> ParameterEstimate:
    """The guess of a network that gives the classes of each parameter `chances` (parameters, most classes). Of a
    continuous parameter the search begins with the mean of its values by their probabilities: of many that are nearly
    as likely it is wrong by less than the likeliest."""
    probabilities = {}
    for parameter, row in zip(program.parameters, chances, strict=True):
        shown = row[: len(parameter.values)]
        probabilities[parameter.name] = shown / max(float(shown.sum()), 1e-300)
    start = ParameterEstimate(probabilities).values(program)
    for parameter in program.parameters:
        if parameter.kind == "continuous":
            low, *_, high = places = np.array(parameter.values, dtype=np.float64)
            start[parameter.name] = float(np.clip(probabilities[parameter.name] @ places, low, high))
    return ParameterEstimate(probabilities, start)


def base_estimate(program: Program) -> ParameterEstimate:
    """The guess of who knows nothing but the program: its base shape, every other value as likely as any."""
    probabilities = {}
    for each in program.parameters:
        chances = np.full(len(each.values), 1.0 / (len(each.values) + 1))
        chances[each.class_of(each.base)] *= 2.0
        probabilities[each.name] = chances
    return ParameterEstimate(probabilities, program.schema.base)  # which need not be among the values of classes


def _surprise(parameter: Parameter, chances: FloatArray, value: Value) -> float:
    if parameter.kind != "continuous":
        return float(np.log(chances.max() / max(chances[parameter.class_of(value)], LEAST_CHANCE)))
    places = np.array(parameter.values, dtype=np.float64)
    mean = float(chances @ places / chances.sum())
    variance = float(chances @ (places - mean) ** 2 / chances.sum()) + (places[1] - places[0]) ** 2 / 12.0
    return float((float(value) - mean) ** 2 / (2.0 * variance))
