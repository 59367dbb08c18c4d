"""Estimates of parameters: probabilities of the values of each, before any shape is tried."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stages.programs.parameters import Parameter, Value
from stages.programs.program import Program
from stages.programs.schema import Values
from stages.shape.arrays import FloatArray

MIN_PROBABILITY = 1e-4
"""Of a value in the surprise: the network may be wrong."""


@dataclass(frozen=True)
class ParameterEstimate:
    """What is known about the parameters.

    probabilities: by name, float64 (values,), of each parameter's values, were it visible
    start: the values where a search begins; None: the likeliest
    """

    probabilities: dict[str, FloatArray]
    start: Values | None = None

    def values(self, program: Program) -> dict[str, Value]:
        """The value of each parameter where a search begins, hidden or not."""
        if self.start is not None:
            return dict(self.start)
        return {
            parameter.name: parameter.values[int(self.probabilities[parameter.name].argmax())]
            for parameter in program.parameters
        }

    def certainty(self, name: str) -> float:
        """The probability of the likeliest value."""
        return float(self.probabilities[name].max())

    def surprise(self, program: Program, canonical: Values) -> float:
        """How much less likely visible values are than the likeliest, in nats.

        Continuous ones have the normal distribution with the mean and the variance of the probabilities.
        """
        _, visible = program.schema.canonical(canonical)
        return sum(
            _surprise(parameter, self.probabilities[parameter.name], canonical[parameter.name])
            for parameter in program.parameters
            if parameter.name in visible
        )


def estimate_from_probabilities(program: Program, probabilities: FloatArray) -> ParameterEstimate:
    """The estimate of a network that gives the classes of each parameter (parameters, most classes).

    A search begins at the mean of a continuous parameter: where many values are nearly as likely, it is less wrong than
    the likeliest.
    """
    by_name = {}
    for parameter, row in zip(program.parameters, probabilities, strict=True):
        visible = row[: len(parameter.values)]
        by_name[parameter.name] = visible / max(float(visible.sum()), 1e-300)
    start = ParameterEstimate(by_name).values(program)
    for parameter in program.parameters:
        if parameter.kind == "continuous":
            low, *_, high = values = np.array(parameter.values, dtype=np.float64)
            start[parameter.name] = float(np.clip(by_name[parameter.name] @ values, low, high))
    return ParameterEstimate(by_name, start)


def base_estimate(program: Program) -> ParameterEstimate:
    """The estimate without a network: the base shape, all other values equally likely."""
    probabilities = {}
    for parameter in program.parameters:
        equal = np.full(len(parameter.values), 1.0 / (len(parameter.values) + 1))
        equal[parameter.class_of(parameter.base)] *= 2.0
        probabilities[parameter.name] = equal
    return ParameterEstimate(probabilities, program.schema.base)  # bases need not be among the listed values


def _surprise(parameter: Parameter, probabilities: FloatArray, value: Value) -> float:
    if parameter.kind != "continuous":
        probability = max(probabilities[parameter.class_of(value)], MIN_PROBABILITY)
        return float(np.log(probabilities.max() / probability))
    values = np.array(parameter.values, dtype=np.float64)
    mean = float(probabilities @ values / probabilities.sum())
    variance = float(probabilities @ (values - mean) ** 2 / probabilities.sum()) + (values[1] - values[0]) ** 2 / 12.0
    return float((float(value) - mean) ** 2 / (2.0 * variance))
