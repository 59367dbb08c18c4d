"""A parameter of a program: its name, kind, range, values, group, and when it is visible (geocode §3.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from stages.programs.conditions import Condition

Kind = Literal["discrete", "binary", "continuous"]

Value = bool | int | float


class ParameterError(ValueError):
    """A parameter that is not there, or a value outside its range; the message names both."""


@dataclass(frozen=True)
class Parameter:
    """One parameter.

    values: ascending; all values of a discrete or binary parameter, of a continuous one those that datasets are
    sampled at and that recovery tells apart (geocode §3.3), its range being from the first to the last of them.
    base: the value that it has while nobody sets it, and wherever it is hidden.
    group: what `mix` copies together; sentence: what it does, for people.
    visible_if: when a change of it can be seen; None is always. Its class is `hidden` where it cannot.
    """

    name: str
    kind: Kind
    values: tuple[Value, ...]
    base: Value
    group: str
    description: str
    visible_if: Condition | None = None

    def __post_init__(self) -> None:
        if len(self.values) < 2 or any(a >= b for a, b in zip(self.values, self.values[1:], strict=False)):
            raise ValueError(f"parameter {self.name}: values must be at least two, ascending; got {self.values}")
        self.checked(self.base)

    @property
    def classes(self) -> int:
        """How many classes recovery tells apart: the values, and one more where it can be hidden."""
        return len(self.values) + (self.visible_if is not None)

    @property
    def range(self) -> str:
        """Its range, for people: `0.2 to 1.0`, `3, 4, 5`, `false or true`."""
        if self.kind == "continuous":
            return f"{self.values[0]} to {self.values[-1]}"
        return "false or true" if self.kind == "binary" else ", ".join(str(each) for each in self.values)

    def checked(self, value: Any) -> Value:
        """`value` in the parameter's own type: float, int or bool. Raises ParameterError for one out of range."""
        yes_or_no = isinstance(value, bool | np.bool_)
        number_like = isinstance(value, int | float | np.integer | np.floating) and math.isfinite(value)
        if (yes_or_no and self.kind == "binary") or (number_like and not yes_or_no):
            number = float(value) + 0.0  # there is one zero, with one text
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
    sentence: str,
    visible_if: str | None = None,
) -> Parameter:
    """A parameter from `low` to `high`, sampled at `steps` values at equal distances, to four decimals."""
    values = tuple(round(float(each), 4) for each in np.linspace(low, high, steps))
    return Parameter(name, "continuous", values, base, group, sentence, _rule(visible_if))


def discrete(
    name: str, low: int, high: int, base: int, group: str, sentence: str, visible_if: str | None = None
) -> Parameter:
    """A whole number from `low` to `high`, both included."""
    return Parameter(name, "discrete", tuple(range(low, high + 1)), base, group, sentence, _rule(visible_if))


def binary(name: str, base: bool, group: str, sentence: str, visible_if: str | None = None) -> Parameter:
    """A yes or no."""
    return Parameter(name, "binary", (False, True), base, group, sentence, _rule(visible_if))


def _rule(text: str | None) -> Condition | None:
    return None if text is None else Condition(text)
