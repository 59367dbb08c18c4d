"""Parameters of a program: name, kind, range, values, group, and when they are visible (geocode §3.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

import numpy as np

from stages.programs.conditions import Condition

Kind = Literal["discrete", "binary", "continuous"]

Value = bool | int | float


class ParameterError(ValueError):
    """An unknown parameter, or a value out of range; the message names both."""


@dataclass(frozen=True)
class Parameter:
    """One parameter.

    values: ascending; all values of a discrete or binary parameter; of a continuous one those that datasets are
    sampled at and that recovery distinguishes (geocode §3.3), from the lowest to the highest of its range
    base: its value by default, and where it is hidden
    group: parameters that `mix` copies together
    description: what it does, for people
    visible_if: when a change of it can be seen; None: always. Elsewhere its class is the hidden one.
    """

    name: str
    kind: Kind
    values: tuple[Value, ...]
    base: Value
    group: str
    description: str
    visible_if: Condition | None = None

    def __post_init__(self) -> None:
        if len(self.values) < 2 or any(low >= high for low, high in pairwise(self.values)):
            raise ValueError(f"parameter {self.name}: values must be at least two, ascending; got {self.values}")
        self.checked(self.base)

    @property
    def classes(self) -> int:
        """The number of classes in recovery: the values, and one more where it can be hidden."""
        return len(self.values) + (self.visible_if is not None)

    @property
    def range(self) -> str:
        """The range for people: `0.2 to 1.0`, `3, 4, 5`, `false or true`."""
        if self.kind == "continuous":
            return f"{self.values[0]} to {self.values[-1]}"
        return "false or true" if self.kind == "binary" else ", ".join(map(str, self.values))

    def checked(self, value: Any) -> Value:
        """Convert `value` to the parameter's own type. Raises ParameterError for one out of range."""
        is_bool = isinstance(value, bool | np.bool_)
        is_number = isinstance(value, int | float | np.integer | np.floating) and math.isfinite(value)
        if (is_bool and self.kind == "binary") or (is_number and not is_bool):
            number = float(value) + 0.0  # no negative zero, which has another text
            if self.kind == "continuous" and self.values[0] <= number <= self.values[-1]:
                return number
            if self.kind != "continuous" and number in self.values:
                return bool(number) if self.kind == "binary" else int(number)
        raise ParameterError(f"parameter {self.name}: {value!r} is out of range; it may be {self.range}")

    def class_of(self, value: Value) -> int:
        """The class of a visible value: the index of the nearest of `values`."""
        return int(np.abs(np.asarray(self.values, dtype=float) - float(value)).argmin())


def continuous(
    name: str,
    low: float,
    high: float,
    steps: int,
    base: float,
    group: str,
    description: str,
    visible_if: str | None = None,
) -> Parameter:
    """Make a parameter from `low` to `high`, with `steps` evenly spaced values, rounded to four decimals."""
    values = tuple(round(float(value), 4) for value in np.linspace(low, high, steps))
    return Parameter(name, "continuous", values, base, group, description, _condition(visible_if))


def discrete(
    name: str, low: int, high: int, base: int, group: str, description: str, visible_if: str | None = None
) -> Parameter:
    """Make a parameter that is a whole number from `low` to `high`, both included."""
    return Parameter(name, "discrete", tuple(range(low, high + 1)), base, group, description, _condition(visible_if))


def binary(name: str, base: bool, group: str, description: str, visible_if: str | None = None) -> Parameter:
    """Make a parameter that is true or false."""
    return Parameter(name, "binary", (False, True), base, group, description, _condition(visible_if))


def _condition(text: str | None) -> Condition | None:
    return None if text is None else Condition(text)
