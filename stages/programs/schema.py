"""The schema of a program: which parameters are visible, and values as vectors, classes and JSON."""

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
"""The value of each parameter by name, in the parameters' order: float, int or bool by its kind."""


@dataclass(frozen=True)
class Schema:
    """Parameters in a fixed order.

    Raises ValueError for two of one name, and for conditions of visibility that are cyclic or use an unknown parameter.
    """

    parameters: tuple[Parameter, ...]

    def __post_init__(self) -> None:
        if len(self.by_name) < len(self.parameters):
            raise ValueError("two parameters have one name")
        for parameter in self.parameters:
            for name in parameter.visible_if.names if parameter.visible_if else ():
                if name not in self.by_name:
                    raise ValueError(f"parameter {parameter.name} is visible by {name}, which is no parameter")
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
        """The parameters, each after those that its visibility depends on."""
        needs = {
            parameter.name: parameter.visible_if.names if parameter.visible_if else () for parameter in self.parameters
        }
        try:
            return tuple(self.by_name[name] for name in TopologicalSorter(needs).static_order())
        except CycleError as error:
            raise ValueError(f"visibility is cyclic: {', '.join(error.args[1])}") from error

    def canonical(self, values: Values) -> tuple[dict[str, Value], frozenset[str]]:
        """The canonical values, with hidden parameters at their base, and the names of the visible parameters.

        Conditions of visibility see canonical values, so a hidden parameter counts as its base.
        """
        canonical: dict[str, Value] = {}
        visible = set()
        for parameter in self._by_dependence:
            if parameter.visible_if is None or parameter.visible_if.holds(canonical):
                visible.add(parameter.name)
                canonical[parameter.name] = values[parameter.name]
            else:
                canonical[parameter.name] = parameter.base
        return {name: canonical[name] for name in self.by_name}, frozenset(visible)

    def canonical_columns(self, columns: FloatArray) -> tuple[FloatArray, BoolArray]:
        """`canonical` for many shapes at once.

        columns: float64 (parameters, n), in the parameters' order
        returns: canonical values, float64 (parameters, n), and visibility, bool (parameters, n)
        """
        canonical, visible = columns.copy(), np.ones(columns.shape, dtype=np.bool_)
        values = dict(zip(self.by_name, canonical, strict=True))
        visible_rows = dict(zip(self.by_name, visible, strict=True))
        for parameter in self._by_dependence:
            if parameter.visible_if is not None:
                row = visible_rows[parameter.name]
                row[:] = parameter.visible_if.holds(values)
                values[parameter.name][~row] = float(parameter.base)
        return canonical, visible

    def complete(self, partial: Mapping[str, Any]) -> dict[str, Value]:
        """`partial` with the base of every other parameter. Raises ParameterError for an unknown parameter and for a
        value out of range."""
        for name in partial:
            if name not in self.by_name:
                close = nearest_word(name, self.by_name)
                hint = f"did you mean {close} ({self.by_name[close].range})?" if close else "see the table of them"
                raise ParameterError(f"there is no parameter {name!r}; {hint}")
        return {
            name: parameter.checked(partial[name]) if name in partial else parameter.base
            for name, parameter in self.by_name.items()
        }

    def to_text(self, values: Values) -> str:
        """The visible values as canonical JSON on one line: equal exactly for values with equal shapes."""
        canonical, visible = self.canonical(values)
        shown = {name: value for name, value in canonical.items() if name in visible}
        return json.dumps(shown, ensure_ascii=False, separators=(",", ":"))

    def from_text(self, text: str) -> dict[str, Value]:
        """Parse canonical values from a JSON object.

        Raises ParameterError for another text, for an unknown parameter, and for one out of range or visible and
        missing.
        """
        try:
            given = json.loads(text)
        except json.JSONDecodeError as error:
            raise ParameterError(f"parameters must be a JSON object: {error}") from error
        if not isinstance(given, dict):
            raise ParameterError(f"parameters must be a JSON object, not {text[:40]!r}")
        canonical, visible = self.canonical(self.complete(given))
        for name in self.by_name:
            if name in visible and name not in given:
                raise ParameterError(f"parameter {name} is missing; it may be {self.by_name[name].range}")
        return canonical

    def from_vector(self, vector: Sequence[float] | FloatArray) -> dict[str, Value]:
        """The values of a vector (parameters,). Raises ParameterError for another length and values out of range."""
        if len(vector) != len(self.parameters):
            raise ParameterError(f"a vector of {len(vector)} numbers for {len(self.parameters)} parameters")
        return self.complete(dict(zip(self.by_name, vector, strict=True)))

    def to_classes(self, values: Values) -> npt.NDArray[np.int64]:
        """The class of each parameter, int64 (parameters,): the index of its nearest value, or the hidden class
        (geocode §3.3 and App. C)."""
        canonical, visible = self.canonical(values)
        return np.array(
            [
                parameter.class_of(canonical[name]) if name in visible else len(parameter.values)
                for name, parameter in self.by_name.items()
            ],
            dtype=np.int64,
        )

    def from_classes(self, classes: Sequence[int] | npt.NDArray[np.int64]) -> dict[str, Value]:
        """The canonical values of classes (parameters,).

        Classes may disagree about what is hidden, as those of a network do: a visible parameter with the hidden class
        gets its base. Raises ParameterError for an unknown class.
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
