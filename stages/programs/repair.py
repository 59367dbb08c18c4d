"""Repair: the nearest values that keep every constraint."""

from __future__ import annotations

import itertools
from collections.abc import Collection

from stages.programs.parameters import Parameter, Value
from stages.programs.program import Program
from stages.programs.schema import Values


def repair(program: Program, values: Values, keep: Collection[str] = ()) -> dict[str, Value] | None:
    """Settled `values` that break no constraint, or None where that takes a change of the parameters `keep`.

    Of each broken constraint the parameters that may move do so, to those of their listed values that break fewest
    constraints, and among these to the nearest: the sum of the moves, as shares of the parameters' ranges, is least.
    """
    settled, _ = program.schema.canonical(values)
    broken = program.violated(settled)
    while broken:
        movable = [program.schema.by_name[name] for name in broken[0].condition.names if name not in keep]
        offers = [(settled[each.name], *each.values) for each in movable]
        moves = [dict(zip((each.name for each in movable), offer, strict=True)) for offer in itertools.product(*offers)]
        changed = [program.schema.canonical({**settled, **move})[0] for move in moves]
        cost = [
            (len(program.violated(after)), sum(_distance(each, settled, after) for each in movable))
            for after in changed
        ]
        best = min(range(len(moves)), key=cost.__getitem__)
        if cost[best][0] >= len(broken):
            return None
        settled = changed[best]
        broken = program.violated(settled)
    return settled


def _distance(parameter: Parameter, before: Values, after: Values) -> float:
    span = float(parameter.values[-1]) - float(parameter.values[0])
    return abs(float(after[parameter.name]) - float(before[parameter.name])) / span
