"""The parameters of a program together: what is visible, and values as vectors, classes and JSON."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from graphlib import CycleError, TopologicalSorter
from typing import Any

import numpy as np
import numpy.typing as npt

from pipeline.config import nearest_word
from stages.programs.parameters import Parameter, ParameterError, Value
from stages.shape.arrays import BoolArray, FloatArray

Values = Mapping[str, Any]
"""A value for each parameter, by name, in the parameters' order: float, int or bool as its kind says."""


@dataclass(frozen=True)
class Schema:
    """Parameters in a fixed order. Raises ValueError for two of one name, and for visibility rules that speak of
    parameters which are not there or that go round in a circle."""

    parameters: tuple[Parameter, ...]

    def __post_init__(self) -> None:
        if len(self.by_name) < len(self.parameters):
            raise ValueError("two parameters have one name")
        for parameter in self.parameters:
            for name in parameter.visible_if.names if parameter.visible_if else ():
                if name not in self.by_name:
                    raise ValueError(f"parameter {parameter.name} is visible by {name}, which is not there")
        _ = self._by_dependence

    @cached_property
    def by_name(self) -> dict[str, Parameter]:
        """The parameters by name, in order."""
        return {parameter.name: parameter for parameter in self.parameters}

    @cached_property
    def groups(self) -> tuple[str, ...]:
        """The groups, in the order of their first parameters."""
        return tuple(dict.fromkeys(parameter.group for parameter in self.parameters))

    @cached_property
    def base(self) -> dict[str, Value]:
        """The base value of each parameter."""
        return {parameter.name: parameter.base for parameter in self.parameters}

    @cached_property
    def _by_dependence(self) -> tuple[Parameter, ...]:
        """Each parameter after those that its visibility depends on."""
        needs = {each.name: each.visible_if.names if each.visible_if else () for each in self.parameters}
        try:
            return tuple(self.by_name[name] for name in TopologicalSorter(needs).static_order())
        except CycleError as error:
            raise ValueError(f"visibility goes round in a circle: {', '.join(error.args[1])}") from error

    def canonical(self, values: Values) -> tuple[dict[str, Value], frozenset[str]]:
        """`values` with hidden parameters at their base, and the names of the visible parameters.

        Visibility is asked of settled values, so that what hides behind a hidden parameter is decided by the base,
        and settled values are settled.
        """
        settled: dict[str, Value] = {}
        visible = set()
        for parameter in self._by_dependence:
            if parameter.visible_if is None or parameter.visible_if.holds(settled):
                visible.add(parameter.name)
                settled[parameter.name] = values[parameter.name]
            else:
                settled[parameter.name] = parameter.base
        return {name: settled[name] for name in self.by_name}, frozenset(visible)

    def canonical_columns(self, columns: FloatArray) -> tuple[FloatArray, BoolArray]:
        """The settled values of many shapes at once, float64 (parameters, n), and what is visible, bool (parameters,
        n), for `columns` (parameters, n) in the parameters' order."""
        settled, visible = columns.copy(), np.ones(columns.shape, dtype=np.bool_)
        rows = dict(zip(self.by_name, settled, strict=True))
        places = {name: place for place, name in enumerate(self.by_name)}
        for parameter in self._by_dependence:
            if parameter.visible_if is not None:
                shown = visible[places[parameter.name]]
                shown[:] = parameter.visible_if.holds(rows)
                rows[parameter.name][~shown] = float(parameter.base)
        return settled, visible

    def complete(self, chosen: Mapping[str, Any]) -> dict[str, Value]:
        """`chosen` with the base of every other parameter. Raises ParameterError for a parameter that is not there
        or a value out of range."""
        for name in chosen:
            if name not in self.by_name:
                close = nearest_word(name, self.by_name)
                hint = f"did you mean {close} ({self.by_name[close].range})?" if close else "see the table of them"
                raise ParameterError(f"there is no parameter {name!r}; {hint}")
        return {
            name: each.checked(chosen[name]) if name in chosen else each.base for name, each in self.by_name.items()
        }

    def to_text(self, values: Values) -> str:
        """The visible values as canonical JSON on one line: equal exactly for values that look the same."""
        settled, visible = self.canonical(values)
        shown = {name: value for name, value in settled.items() if name in visible}
        return json.dumps(shown, ensure_ascii=False, separators=(",", ":"))

    def from_text(self, text: str) -> dict[str, Value]:
        """The settled values that `text` of this schema says. Raises ParameterError for anything that is no JSON
        object of parameters, for a parameter not there, out of range, or visible and not said."""
        try:
            said = json.loads(text)
        except json.JSONDecodeError as error:
            raise ParameterError(f"parameters must be a JSON object: {error}") from error
        if not isinstance(said, dict):
            raise ParameterError(f"parameters must be a JSON object, not {text[:40]!r}")
        settled, visible = self.canonical(self.complete(said))
        for name in self.by_name:
            if name in visible and name not in said:
                raise ParameterError(f"parameter {name} is missing; it may be {self.by_name[name].range}")
        return settled

    def to_vector(self, values: Values) -> FloatArray:
        """The settled values as numbers, float64 (parameters,)."""
        settled, _ = self.canonical(values)
        return np.array([float(value) for value in settled.values()])

    def from_vector(self, vector: Sequence[float] | FloatArray) -> dict[str, Value]:
        """The values in a vector (parameters,). Raises ParameterError for one of another length or out of range."""
        if len(vector) != len(self.parameters):
            raise ParameterError(f"a vector of {len(vector)} numbers for {len(self.parameters)} parameters")
        return self.complete(dict(zip(self.by_name, vector, strict=True)))

    def to_classes(self, values: Values) -> npt.NDArray[np.int64]:
        """The class of each parameter, int64 (parameters,): the index of the nearest of its values, or its hidden
        class (geocode §3.3 and App. C)."""
        settled, visible = self.canonical(values)
        return np.array(
            [
                parameter.class_of(settled[name]) if name in visible else len(parameter.values)
                for name, parameter in self.by_name.items()
            ],
            dtype=np.int64,
        )

    def from_classes(self, classes: Sequence[int] | npt.NDArray[np.int64]) -> dict[str, Value]:
        """The settled values of given classes (parameters,).

        Classes need not agree about what is hidden, as a network's need not: a parameter that is visible beside the
        others and has the hidden class gets its base. Raises ParameterError for a class that is not there.
        """
        if len(classes) != len(self.parameters):
            raise ParameterError(f"{len(classes)} classes for {len(self.parameters)} parameters")
        values = {}
        for parameter, number in zip(self.parameters, classes, strict=True):
            if not 0 <= number < parameter.classes:
                raise ParameterError(
                    f"parameter {parameter.name}: class {number} is not in 0 to {parameter.classes - 1}"
                )
            values[parameter.name] = parameter.base if number == len(parameter.values) else parameter.values[number]
        return self.canonical(values)[0]
