"""The shapes of the library's programs, recorded in `tests/data/programs`: declarations, each part of the base shape
and of three random shapes, and the whole at every value of every parameter.

`python -m tests.stages.programs.truth` records them again after an intended change of shapes.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stages.programs.curves import Part
from stages.programs.draws import Share
from stages.programs.program import Program, find_program, program_names
from stages.programs.repair import repair
from stages.programs.sampling import Sampler
from stages.programs.schema import Values

FOLDER = Path(__file__).resolve().parents[2] / "data" / "programs"

SEEDS = (1, 10, 13)
"""With these and the base, every parameter takes effect; a test checks it."""

REFERENCE_POINT = (0.1, 0.2, 0.3)
"""On no plane or axis of symmetry, and near enough that small changes show."""


def declared(program: Program) -> dict[str, Any]:
    """The declaration of a program: of each parameter its group, condition of visibility, base and values."""
    return {
        "labels": list(program.labels),
        "constraints": {constraint.name: constraint.condition.text for constraint in program.constraints},
        "non_intersecting": [list(pair) for pair in program.non_intersecting],
        "view_elevation": program.view_elevation,
        "parameters": {
            parameter.name: [
                parameter.group,
                parameter.visible_if.text if parameter.visible_if else "",
                parameter.base,
                *parameter.values,
            ]
            for parameter in program.parameters
        },
    }


def measured(parts: Sequence[Part]) -> list[list[Any]]:
    """Label, colour, volume, lowest and highest corner of each part."""
    return [[part.label, *part.color, part.mesh.volume, *part.mesh.bounds.ravel().tolist()] for part in parts]


def by_value(program: Program, values: Values, name: str) -> list[list[float]]:
    """Volume and mean distance of the vertices from a point, at each value of the parameter `name`.

    The other parameters are as near to `values` as constraints admit; a row is empty where they admit nothing.
    """
    rows = []
    for value in program.schema.by_name[name].values:
        changed = repair(program, {**values, name: value}, {name})
        meshes = [part.mesh for part in program.parts(changed)] if changed is not None else []
        distances = [np.linalg.norm(mesh.vertices - REFERENCE_POINT, axis=1) for mesh in meshes]
        rows.append([sum(mesh.volume for mesh in meshes), float(np.concatenate(distances).mean())] if meshes else [])
    return rows


def described(program: Program) -> dict[str, Any]:
    """The content of the program's file."""
    schema = program.schema
    random = [Sampler(program, Share(), off_grid=True).find(None, np.random.default_rng(seed)) for seed in SEEDS]
    return {
        "declared": declared(program),
        "shapes": [
            {
                "values": schema.to_text(values),
                "parts": measured(program.parts(values)),
                "by_value": {name: by_value(program, values, name) for name in schema.by_name},
            }
            for values in [schema.canonical(schema.base)[0], *random]
        ],
    }


def lines(value: Any, depth: int = 4) -> str:
    """JSON with a line for each entry down to `depth`, and eight significant digits."""
    if depth and isinstance(value, dict):
        return (
            "{\n" + ",\n".join(f"{json.dumps(key)}: {lines(entry, depth - 1)}" for key, entry in value.items()) + "\n}"
        )
    if depth and isinstance(value, list):
        return "[\n" + ",\n".join(lines(entry, depth - 1) for entry in value) + "\n]"
    return json.dumps(json.loads(json.dumps(value), parse_float=lambda text: float(f"{float(text):.8g}") + 0.0))


if __name__ == "__main__":
    FOLDER.mkdir(parents=True, exist_ok=True)
    for program_name in program_names():
        (FOLDER / f"{program_name}.json").write_text(
            lines(described(find_program(program_name))) + "\n", encoding="utf-8"
        )
