"""Refinement by synthesis: search the parameters whose shape is nearest to a target, from an initial estimate.

A program builds a shape in about a millisecond, so hundreds can be tried. Uncertain parameters come first: each alone,
from value to value; then several discrete ones at once, at random; then continuous ones off the grid of their values.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from stages.programs.parameters import Parameter, Value
from stages.programs.program import BuildError, Program
from stages.programs.schema import Values
from stages.recovery.target import RecoveryTarget
from stages.training.recovery.estimate import ParameterEstimate
from stages.training.recovery.shapes import nearest_valid_values

EVOLUTION_SHAPES = 60
"""Shapes tried with several changed discrete parameters, between passes over single parameters."""
MAX_MUTATED_PARAMETERS = 3
MAX_CHOICE_VALUES = 2
"""Values of a choice that are tried, where it brings other parameters into view."""
MAX_REVEALED_PARAMETERS = 6
"""Parameters that are fitted after a choice has brought them into view."""
MAX_REVEALED_COST_RATIO = 3.0
"""They are not fitted where the choice has made the cost this much higher."""
MAX_CHOICE_CERTAINTY = 0.8
"""A choice is left as estimated where its probability is higher."""
MIN_EFFECT = 0.01
"""A parameter that has changed the distance by a smaller share is left until the end."""
MIN_DISTANCE = 1e-12
"""Avoids a division by zero: a drawing of the shape itself has distance 0."""
MIN_OFF_GRID_STEP = 0.1
"""Smallest step of a continuous parameter, in steps between its listed values."""


@dataclass(frozen=True)
class RefinedShape:
    """The result of a search.

    values: canonical and valid
    distance: from the target
    target: as it was aligned
    tried: shapes that were built
    """

    values: dict[str, Value]
    distance: float
    target: RecoveryTarget
    tried: int


def refine_estimate(
    program: Program,
    estimate: ParameterEstimate,
    target: RecoveryTarget,
    budget: int,
    rng: np.random.Generator,
    surprise_cost: float = 0.0,
    chance_distance: float = 0.0,
) -> RefinedShape:
    """Find the nearest shape with at most `budget` shapes, never farther than that of the estimate itself.

    surprise_cost: cost of a nat of surprise, as a share of the distance
    chance_distance: distances below this do not differ
    """
    search = _Search(program, estimate, target, budget, rng, surprise_cost, chance_distance, estimate.values(program))
    search.begin()
    while search.tried < budget:
        before = search.cost
        search.vary_single(1)
        search.vary_choices()
        search.vary_single(2)
        search.evolve(EVOLUTION_SHAPES)
        search.vary_single(None)
        search.vary_off_grid()
        if search.cost >= before:
            break
    return RefinedShape(search.values, search.distance, search.target, search.tried)


@dataclass
class _Search:
    """The state of a search.

    wanted: a value of each parameter, hidden ones included, so that a parameter that comes into view has its estimate
    values: the canonical valid values for `wanted`
    distance, cost: of these values; the cost is minimised
    """

    program: Program
    estimate: ParameterEstimate
    target: RecoveryTarget
    budget: int
    rng: np.random.Generator
    surprise_cost: float
    chance_distance: float
    wanted: dict[str, Value]
    values: dict[str, Value] = field(default_factory=dict)
    distance: float = float("inf")
    cost: float = float("inf")
    tried: int = 0
    _effects: dict[str, float] = field(default_factory=dict)
    _known: set[str] = field(default_factory=set)

    def begin(self) -> None:
        self.values = nearest_valid_values(self.program, self.wanted)
        self._align()

    def vary_single(self, max_passes: int | None) -> None:
        """Move each visible parameter alone along its listed values, until none improves the cost."""
        improved, passes = True, 0
        while improved and self.tried < self.budget and passes != max_passes:
            improved = False
            passes += 1
            for parameter in self._uncertain_first():
                if parameter.name in self._visible() and self._effects.get(parameter.name, 1.0) >= MIN_EFFECT:
                    for path in self._value_paths(parameter):
                        improved |= self._walk(parameter, path)
            if improved:
                self._align()

    def vary_choices(self) -> None:
        """Change each choice that brings other parameters into view, and fit these before comparing.

        An arm rest of the wrong height is no better than none.
        """
        choices = {
            name for parameter in self.program.parameters if parameter.visible_if for name in parameter.visible_if.names
        }
        for parameter in self._uncertain_first():
            if parameter.kind == "continuous" or parameter.name not in choices:
                continue
            if self.estimate.certainty(parameter.name) > MAX_CHOICE_CERTAINTY:
                return
            probabilities = self.estimate.probabilities[parameter.name]
            for index in np.argsort(-probabilities, kind="stable")[:MAX_CHOICE_VALUES].tolist():
                if self.tried < self.budget and parameter.values[index] != self.values[parameter.name]:
                    self._choose(parameter.name, parameter.values[index])

    def evolve(self, shapes: int) -> None:
        """Change several discrete parameters at once, drawn by their probabilities; keep what is nearer."""
        discrete = [parameter for parameter in self.program.parameters if parameter.kind != "continuous"]
        if not discrete:
            return
        doubts = np.array([1.02 - self.estimate.certainty(parameter.name) for parameter in discrete])
        for _ in range(shapes):
            count = int(self.rng.integers(1, min(MAX_MUTATED_PARAMETERS, len(discrete)) + 1))
            change = {}
            for row in self.rng.choice(len(discrete), count, replace=False, p=doubts / doubts.sum()).tolist():
                weights = np.sqrt(self.estimate.probabilities[discrete[row].name] + 1e-3)
                index = int(self.rng.choice(len(weights), p=weights / weights.sum()))
                change[discrete[row].name] = discrete[row].values[index]
            self._try(change)

    def vary_off_grid(self) -> None:
        """Move continuous parameters off their listed values, in steps that get smaller."""
        continuous = [parameter for parameter in self._uncertain_first() if parameter.kind == "continuous"]
        share = 0.5
        while share >= MIN_OFF_GRID_STEP and self.tried < self.budget:
            for parameter in continuous:
                if parameter.name not in self._visible():
                    continue
                step = share * (float(parameter.values[-1]) - float(parameter.values[0])) / (len(parameter.values) - 1)
                for sign in (1.0, -1.0):
                    path = _off_grid_values(parameter, self.wanted, sign * step)
                    if self.tried >= self.budget or self._walk(parameter, path):
                        break
            self._align()
            share /= 2.0

    def _value_paths(self, parameter: Parameter) -> list[Iterator[Value]]:
        """Paths from the present value: up and down step by step, and jumps to the likeliest others."""
        index = parameter.class_of(self.wanted[parameter.name])
        if parameter.kind == "binary":
            return [iter(parameter.values[1 - index : 2 - index])]
        likeliest = np.argsort(-self.estimate.probabilities[parameter.name], kind="stable")[:2].tolist()
        jumps = [[parameter.values[other]] for other in likeliest if abs(other - index) > 1]
        return [iter(parameter.values[index + 1 :]), iter(parameter.values[:index][::-1]), *map(iter, jumps)]

    def _choose(self, name: str, value: Value) -> None:
        """Set a choice, fit the parameters that it brings into view, and undo all of it where the cost is no lower."""
        if name not in self._visible():
            return
        before = self.wanted, self.values, self.distance, self.cost, self.target
        visible_before, cost_before = self._visible(), self.cost
        self.distance = self.cost = 1e9
        if self._try({name: value}):
            revealed = self._visible() - visible_before
            fitted = [parameter for parameter in self._uncertain_first() if parameter.name in revealed]
            if self.cost >= MAX_REVEALED_COST_RATIO * cost_before:
                fitted = []
            for parameter in fitted[:MAX_REVEALED_PARAMETERS]:
                for path in self._value_paths(parameter):
                    self._walk(parameter, path)
        if self.cost >= cost_before:
            self.wanted, self.values, self.distance, self.cost, self.target = before

    def _walk(self, parameter: Parameter, path: Iterator[Value]) -> bool:
        """Follow a path of values while the cost falls. Whether it fell."""
        moved = False
        for value in path:
            if not self._try({parameter.name: value}):
                break
            moved = True
        return moved

    def _try(self, change: dict[str, Value]) -> bool:
        """Apply a change where it lowers the cost. Whether it did."""
        if self.tried >= self.budget:
            return False
        wanted = {**self.wanted, **change}
        values = nearest_valid_values(self.program, wanted)
        text = self.program.schema.to_text(values)
        if text in self._known:
            return False
        self._known.add(text)
        self.tried += 1
        try:
            parts = self.program.parts(values)
        except BuildError:
            return False
        distance, target = self.target.compared(parts)
        for name in change if len(change) == 1 else ():
            effect = abs(distance - self.distance) / max(self.distance, MIN_DISTANCE)
            self._effects[name] = max(self._effects.get(name, 0.0), effect)
        cost = self._cost(distance, values)
        if cost >= self.cost:
            return False
        self.distance, self.cost, self.values, self.target = distance, cost, values, target
        self.wanted = {**wanted, **{name: values[name] for name in self._visible()}}
        return True

    def _align(self) -> None:
        """Align the target to the best shape, and forget which others were farther."""
        parts = self.program.parts(self.values)
        self.target = self.target.aligned(parts)
        self.distance, self.target = self.target.compared(parts)
        self.cost = self._cost(self.distance, self.values)
        self.tried += 1
        self._known = {self.program.schema.to_text(self.values)}

    def _cost(self, distance: float, values: Values) -> float:
        surprise = self.estimate.surprise(self.program, values) if self.surprise_cost else 0.0
        return max(distance, self.chance_distance) * (1.0 + self.surprise_cost * surprise)

    def _visible(self) -> frozenset[str]:
        return self.program.schema.canonical(self.values)[1]

    def _uncertain_first(self) -> Sequence[Parameter]:
        return sorted(self.program.parameters, key=lambda parameter: self.estimate.certainty(parameter.name))


def _off_grid_values(parameter: Parameter, wanted: Values, step: float) -> Iterator[Any]:
    """Values from the present one on in steps, to the end of the range."""
    low, high = float(parameter.values[0]), float(parameter.values[-1])
    value = float(wanted[parameter.name])
    while True:
        following = min(max(value + step, low), high)
        if following == value:
            return
        value = round(following, 4)
        yield value
