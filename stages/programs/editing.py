"""Editing: copy groups of parameters from one shape to another, and interpolate two shapes (geocode §4)."""

from __future__ import annotations

from collections.abc import Collection

from stages.programs.parameters import Parameter, ParameterError, Value
from stages.programs.program import Program
from stages.programs.repair import repair
from stages.programs.schema import Values


def mix_values(program: Program, target: Values, source: Values, groups: Collection[str]) -> dict[str, Value]:
    """Copy the parameters of `groups` from `source` to `target`, and repair the result to satisfy the constraints.

    Repair changes copied parameters only where nothing else helps. Raises ParameterError for an unknown group.
    """
    copied = _in_groups(program, groups)
    mixed = {name: (source if name in copied else target)[name] for name in program.schema.by_name}
    return _valid(program, mixed, copied)


def interpolate(
    program: Program, first: Values, last: Values, share: float, groups: Collection[str] = ()
) -> dict[str, Value]:
    """Interpolate from `first` (share 0) to `last` (share 1), and repair the result (geocode, supplement).

    Continuous parameters change linearly, others switch to their nearest value. A parameter that is visible in one of
    the shapes alone has its value there. With `groups`, only their parameters change. Raises ParameterError for an
    unknown group.
    """
    moving = _in_groups(program, groups or program.schema.groups)
    start, shown_first = program.schema.canonical(first)
    end, shown_last = program.schema.canonical(last)
    between: dict[str, Value] = {}
    for name, parameter in program.schema.by_name.items():
        if name not in moving:
            between[name] = start[name]
        elif (name in shown_first) != (name in shown_last):
            between[name] = (start if name in shown_first else end)[name]
        else:
            between[name] = _between(parameter, float(start[name]), float(end[name]), share)
    return _valid(program, between, moving if groups else ())


def _in_groups(program: Program, groups: Collection[str]) -> set[str]:
    """The names of the parameters in groups."""
    for group in groups:
        if group not in program.schema.groups:
            raise ParameterError(f"there is no group {group!r}; groups are {', '.join(program.schema.groups)}")
    return {parameter.name for parameter in program.parameters if parameter.group in groups}


def _between(parameter: Parameter, start: float, end: float, share: float) -> Value:
    value = start + share * (end - start) if share < 1 else end
    if parameter.kind == "continuous":
        return parameter.checked(min(max(value, float(parameter.values[0])), float(parameter.values[-1])))
    # Halfway between two values, the one on the second shape's side is used.
    indices = range(len(parameter.values)) if start > end else range(len(parameter.values) - 1, -1, -1)
    return parameter.values[min(indices, key=lambda index: abs(float(parameter.values[index]) - value))]


def _valid(program: Program, values: Values, keep: Collection[str]) -> dict[str, Value]:
    valid = repair(program, values, keep)
    valid = repair(program, values) if valid is None else valid
    if valid is None:
        violated = ", ".join(constraint.condition.text for constraint in program.violated(values))
        raise ParameterError(f"{program.name}: no values near these satisfy {violated}")
    return valid
