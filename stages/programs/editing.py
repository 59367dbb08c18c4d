"""Editing: groups of parameters copied from one shape to another, and the way between two shapes (geocode §4)."""

from __future__ import annotations

from collections.abc import Collection

from stages.programs.parameters import Parameter, ParameterError, Value
from stages.programs.program import Program
from stages.programs.repair import repair
from stages.programs.schema import Values


def mix(program: Program, target: Values, source: Values, groups: Collection[str]) -> dict[str, Value]:
    """`target` with the parameters of `groups` as they are in `source`, repaired to the constraints.

    Repair moves what was not copied first, and what was copied only where there is no other way. Raises
    ParameterError for a group that is not there.
    """
    copied = _in_groups(program, groups)
    mixed = {name: (source if name in copied else target)[name] for name in program.schema.by_name}
    return _valid(program, mixed, copied)


def interpolate(
    program: Program, first: Values, last: Values, share: float, groups: Collection[str] = ()
) -> dict[str, Value]:
    """The shape at `share` (0 is `first`, 1 is `last`) of the way, repaired to the constraints; of `groups` alone, if
    any are named: the others stay as they are in `first` (geocode, supplement).

    Continuous parameters move linearly, others switch to the nearest of their values. What is visible in one of the
    shapes only has the value that it has there. Raises ParameterError for a group that is not there.
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
    return {each.name for each in program.parameters if each.group in groups}


def _between(parameter: Parameter, start: float, end: float, share: float) -> Value:
    value = start + share * (end - start) if share < 1 else end
    if parameter.kind == "continuous":
        return parameter.checked(min(max(value, float(parameter.values[0])), float(parameter.values[-1])))
    # Halfway between two values the second shape's side wins.
    toward = range(len(parameter.values)) if start > end else range(len(parameter.values) - 1, -1, -1)
    return parameter.values[min(toward, key=lambda index: abs(float(parameter.values[index]) - value))]


def _valid(program: Program, values: Values, keep: Collection[str]) -> dict[str, Value]:
    found = repair(program, values, keep)
    found = repair(program, values) if found is None else found
    if found is None:
        broken = ", ".join(each.condition.text for each in program.violated(values))
        raise ParameterError(f"{program.name}: no values near these keep {broken}")
    return found
