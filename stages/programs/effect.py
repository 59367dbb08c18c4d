"""Whether a parameter takes effect in one shape: asked of the geometry, not of the rules (geocode §4)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stages.programs.curves.part import Part
from stages.programs.program import Program
from stages.programs.repair import repair
from stages.programs.schema import Values

MAX_SAME_POSITION_DISTANCE = 1e-6
"""Vertices nearer than this, in the program's units, are at one place."""


def has_effect(program: Program, values: Values, name: str, parts: Sequence[Part]) -> bool:
    """Whether the shape of valid, settled `values`, made of `parts`, changes when the parameter `name` alone changes
    to the next lower value that it can have here, and when it changes to the next higher.

    What comes into view by the change may move to keep the constraints. A parameter that can have no other value
    here has no effect.
    """
    parameter = program.schema.by_name[name]
    _, visible = program.schema.canonical(values)
    place = parameter.class_of(values[name])
    tried = False
    for others in (parameter.values[:place][::-1], parameter.values[place + 1 :]):
        for other in others:
            changed = repair(program, {**values, name: other}, visible)
            if changed is not None:
                if same_geometry(parts, program.parts(changed)):
                    return False
                tried = True
                break
    return tried


def same_geometry(parts: Sequence[Part], others: Sequence[Part]) -> bool:
    """Whether two shapes are made of the same parts in the same order at the same places."""
    return len(parts) == len(others) and all(
        a.label == b.label
        and a.mesh.vertices.shape == b.mesh.vertices.shape
        and a.mesh.quads.shape == b.mesh.quads.shape
        and bool(np.abs(a.mesh.vertices - b.mesh.vertices).max(initial=0.0) <= MAX_SAME_POSITION_DISTANCE)
        for a, b in zip(parts, others, strict=True)
    )
