"""Whether a parameter takes effect in one shape, decided by its geometry (geocode §4)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stages.programs.curves.part import Part
from stages.programs.program import Program
from stages.programs.repair import repair
from stages.programs.schema import Values

MAX_SAME_POSITION_DISTANCE = 1e-6
"""In the program's units."""


def has_effect(program: Program, values: Values, name: str, parts: Sequence[Part]) -> bool:
    """Whether a shape changes with parameter `name` alone, both to its next lower and to its next higher valid value.

    values: valid and canonical, of the shape made of `parts`. Parameters that come into view may change to satisfy the
    constraints. A parameter without another valid value has no effect.
    """
    parameter = program.schema.by_name[name]
    _, visible = program.schema.canonical(values)
    index = parameter.class_of(values[name])
    tried = False
    for others in (parameter.values[:index][::-1], parameter.values[index + 1 :]):
        for other in others:
            changed = repair(program, {**values, name: other}, visible)
            if changed is not None:
                if same_geometry(parts, program.parts(changed)):
                    return False
                tried = True
                break
    return tried


def same_geometry(parts: Sequence[Part], others: Sequence[Part]) -> bool:
    """Whether two shapes have the same parts in the same order and positions."""
    return len(parts) == len(others) and all(
        a.label == b.label
        and a.mesh.vertices.shape == b.mesh.vertices.shape
        and a.mesh.quads.shape == b.mesh.quads.shape
        and bool(np.abs(a.mesh.vertices - b.mesh.vertices).max(initial=0.0) <= MAX_SAME_POSITION_DISTANCE)
        for a, b in zip(parts, others, strict=True)
    )
