"""Refinement by synthesis: from a first guess, the parameters whose shape lies nearest to a target.

A program makes a shape in about a millisecond, so hundreds can be tried. Where the network is least sure is looked
first: each parameter alone, from value to value; then several discrete ones at once, by chance; then continuous ones
between the values that the network tells apart.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from stages.programs.parameters import Parameter, Value
from stages.programs.program import BuildError, Program
from stages.programs.schema import Values
from stages.recovery.targets import RecoveryTarget
from stages.training.recovery.estimate import ParameterEstimate
from stages.training.recovery.shapes import nearest_valid_values

EVOLUTION = 60
"""Shapes in which several discrete parameters are changed at once, before each alone is looked at again."""
OTHERWISE, FITTED = 2, 6
"""So many values of a choice are tried, and so many of the parameters that it brings into view are fitted, at most."""
SURE = 0.8
"""A choice that the network gives such a probability is not made otherwise."""
WEAK = 0.01
"""A parameter that has not changed the distance by such a share is left until the end."""
TINY = 1e-12
"""Nearer than this nothing is: a drawing of the shape itself has distance 0."""
HOPELESS = 3.0
"""What is so many times farther at first is not fitted."""
MUTATED = 3
"""So many are changed at once at most."""
SMALLEST_STEP = 0.1
"""Where no step of this share between two values is any better, a continuous value is found."""


@dataclass(frozen=True)
class RefinedShape:
    """values: settled and valid; distance: from the target; target: as it was aligned; tried: shapes that were made."""

    values: dict[str, Value]
    distance: float
    target: RecoveryTarget
    tried: int


def refine(
    program: Program,
    guess: ParameterEstimate,
    target: RecoveryTarget,
    budget: int,
    rng: np.random.Generator,
    prior: float = 0.0,
    near: float = 0.0,
) -> RefinedShape:
    """The nearest shape that is found with `budget` shapes at most; never farther than that of the guess itself, as the
    target was aligned to it. prior: the share of its distance that a shape costs for each nat of surprise; near:
    what is nearer is no better, but by chance."""
    search = _Search(program, guess, target, budget, rng, prior, near, guess.values(program))
    search.begin()
    while search.tried < budget:
        before = search.cost
        search.by_classes(1)
        search.by_structure()
        search.by_classes(2)
        search.by_evolution(EVOLUTION)
        search.by_classes(None)
        search.between_classes()
        if search.cost >= before:
            break
    return RefinedShape(search.canonical, search.distance, search.target, search.tried)


@dataclass
class _Search:
    """wanted: a value for each parameter, also of those that are hidden now: what comes into view has what was guessed
    of it. settled: the valid values that it stands for; distance: theirs; cost: what is made less."""

    program: Program
    estimate: ParameterEstimate
    target: RecoveryTarget
    budget: int
    rng: np.random.Generator
    prior: float
    near: float
    wanted: dict[str, Value]
    canonical: dict[str, Value] = field(default_factory=dict)
    distance: float = float("inf")
    cost: float = float("inf")
    tried: int = 0
    _effects: dict[str, float] = field(default_factory=dict)
    _known: set[str] = field(default_factory=set)

    def begin(self) -> None:
        self.canonical = nearest_valid_values(self.program, self.wanted)
        self._align()

    def by_classes(self, passes: int | None) -> None:
        """Each visible parameter in turn to other values that datasets have, until none is better; but first those that
        have moved the shape at all."""
        better = True
        while better and self.tried < self.budget and passes != 0:
            better = False
            passes = None if passes is None else passes - 1
            for parameter in self._unsure_first():
                if parameter.name in self._visible() and self._effects.get(parameter.name, 1.0) >= WEAK:
                    for values in self._ways(parameter):
                        better |= self._walk(parameter, values)
            if better:
                self._align()

    def by_structure(self) -> None:
        """Each choice that brings other parameters into view is made otherwise, and these are fitted before the two
        shapes are compared: an arm rest of a wrong height is no better than none."""
        choices = {name for each in self.program.parameters if each.visible_if for name in each.visible_if.names}
        for parameter in self._unsure_first():
            if parameter.kind == "continuous" or parameter.name not in choices:
                continue
            if self.estimate.certainty(parameter.name) > SURE:
                return
            chances = self.estimate.probabilities[parameter.name]
            for index in np.argsort(-chances, kind="stable")[:OTHERWISE].tolist():
                if self.tried < self.budget and parameter.values[index] != self.canonical[parameter.name]:
                    self._leap(parameter.name, parameter.values[index])

    def by_evolution(self, shapes: int) -> None:
        """Several discrete parameters at once, drawn by their probabilities; what is nearer is kept."""
        discrete = [each for each in self.program.parameters if each.kind != "continuous"]
        if not discrete:
            return
        doubt = np.array([1.02 - self.estimate.certainty(each.name) for each in discrete])
        for _ in range(shapes):
            count = int(self.rng.integers(1, min(MUTATED, len(discrete)) + 1))
            change = {}
            for place in self.rng.choice(len(discrete), count, replace=False, p=doubt / doubt.sum()).tolist():
                chances = np.sqrt(self.estimate.probabilities[discrete[place].name] + 1e-3)
                index = int(self.rng.choice(len(chances), p=chances / chances.sum()))
                change[discrete[place].name] = discrete[place].values[index]
            self._try(change)

    def between_classes(self) -> None:
        """Continuous parameters off the values that datasets have, in steps that get smaller."""
        continuous = [each for each in self._unsure_first() if each.kind == "continuous"]
        step = 0.5
        while step >= SMALLEST_STEP and self.tried < self.budget:
            for parameter in continuous:
                if parameter.name not in self._visible():
                    continue
                size = step * (float(parameter.values[-1]) - float(parameter.values[0])) / (len(parameter.values) - 1)
                for sign in (1.0, -1.0):
                    if self.tried >= self.budget or self._walk(parameter, _steps(parameter, self.wanted, sign * size)):
                        break
            self._align()
            step /= 2.0

    def _ways(self, parameter: Parameter) -> list[Iterator[Value]]:
        """Ways from the present value: up and down step by step, and to the likeliest others."""
        place = parameter.class_of(self.wanted[parameter.name])
        if parameter.kind == "binary":
            return [iter(parameter.values[1 - place : 2 - place])]
        likely = np.argsort(-self.estimate.probabilities[parameter.name], kind="stable")[:2].tolist()
        others = [[parameter.values[index]] for index in likely if abs(index - place) > 1]
        return [iter(parameter.values[place + 1 :]), iter(parameter.values[:place][::-1]), *map(iter, others)]

    def _leap(self, name: str, value: Value) -> None:
        if name not in self._visible():
            return
        before = self.wanted, self.canonical, self.distance, self.cost, self.target
        seen, share = self._visible(), self.cost
        self.distance = self.cost = 1e9
        if self._try({name: value}):
            fresh = [each for each in self._unsure_first() if each.name in self._visible() - seen]
            for parameter in fresh[:FITTED] if self.cost < HOPELESS * share else []:
                for values in self._ways(parameter):
                    self._walk(parameter, values)
        if self.cost >= share:
            self.wanted, self.canonical, self.distance, self.cost, self.target = before

    def _walk(self, parameter: Parameter, values: Iterator[Value]) -> bool:
        """Go on while it gets better."""
        moved = False
        for value in values:
            if not self._try({parameter.name: value}):
                break
            moved = True
        return moved

    def _try(self, change: dict[str, Value]) -> bool:
        """Whether the shape with a change is nearer; then it is taken."""
        if self.tried >= self.budget:
            return False
        wanted = {**self.wanted, **change}
        settled = nearest_valid_values(self.program, wanted)
        text = self.program.schema.to_text(settled)
        if text in self._known:
            return False
        self._known.add(text)
        self.tried += 1
        try:
            parts = self.program.parts(settled)
        except BuildError:
            return False
        distance, target = self.target.compared(parts)
        for name in change if len(change) == 1 else ():
            effect = abs(distance - self.distance) / max(self.distance, TINY)
            self._effects[name] = max(self._effects.get(name, 0.0), effect)
        cost = self._cost(distance, settled)
        if cost >= self.cost:
            return False
        self.distance, self.cost, self.canonical, self.target = distance, cost, settled, target
        self.wanted = {**wanted, **{name: settled[name] for name in self._visible()}}
        return True

    def _align(self) -> None:
        """Place the target anew on the best shape, and forget which others were farther."""
        parts = self.program.parts(self.canonical)
        self.target = self.target.aligned(parts)
        self.distance, self.target = self.target.compared(parts)
        self.cost = self._cost(self.distance, self.canonical)
        self.tried += 1
        self._known = {self.program.schema.to_text(self.canonical)}

    def _cost(self, distance: float, settled: Values) -> float:
        surprise = self.estimate.surprise(self.program, settled) if self.prior else 0.0
        return max(distance, self.near) * (1.0 + self.prior * surprise)

    def _visible(self) -> frozenset[str]:
        return self.program.schema.canonical(self.canonical)[1]

    def _unsure_first(self) -> Sequence[Parameter]:
        return sorted(self.program.parameters, key=lambda each: self.estimate.certainty(each.name))


def _steps(parameter: Parameter, wanted: Values, step: float) -> Iterator[Any]:
    """Values from the present one on, as far as the range goes."""
    low, high = float(parameter.values[0]), float(parameter.values[-1])
    value = float(wanted[parameter.name])
    while True:
        following = min(max(value + step, low), high)
        if following == value:
            return
        value = round(following, 4)
        yield value
