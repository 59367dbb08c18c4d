"""Repair: the nearest values that satisfy every constraint."""

from __future__ import annotations

import itertools
from collections.abc import Collection

from stages.programs.parameters import Parameter, Value
from stages.programs.program import Program
from stages.programs.schema import Values


def repair(program: Program, values: Values, keep: Collection[str] = ()) -> dict[str, Value] | None:
    """Canonical values near `values` that violate no constraint, or None where parameters of `keep` had to change.

    The other parameters of a violated constraint move to those of their listed values that violate the fewest
    constraints. Among these the sum of the moves is least, in shares of the parameters' ranges.
    """
    canonical, _ = program.schema.canonical(values)
    violated = program.violated(canonical)
    while violated:
        movable = [program.schema.by_name[name] for name in violated[0].condition.names if name not in keep]
        names = [parameter.name for parameter in movable]
        candidates = itertools.product(*((canonical[parameter.name], *parameter.values) for parameter in movable))
        moves = [dict(zip(names, candidate, strict=True)) for candidate in candidates]
        changed = [program.schema.canonical({**canonical, **move})[0] for move in moves]
        cost = [
            (len(program.violated(after)), sum(_distance(parameter, canonical, after) for parameter in movable))
            for after in changed
        ]
        best = min(range(len(moves)), key=cost.__getitem__)
        if cost[best][0] >= len(violated):
            return None
        canonical = changed[best]
        violated = program.violated(canonical)
    return canonical


def _distance(parameter: Parameter, before: Values, after: Values) -> float:
    span = float(parameter.values[-1]) - float(parameter.values[0])
    return abs(float(after[parameter.name]) - float(before[parameter.name])) / span
