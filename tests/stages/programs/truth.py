"""What the programs of the library make, written down in `tests/data/programs`: what they declare, each part at the
base and at three random shapes, and the whole at every value of every parameter.

`python -m tests.stages.programs.truth` writes it anew, where a change of shapes is meant.
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
"""With these and the base there is no parameter without effect; a test holds it."""

ASIDE = (0.1, 0.2, 0.3)
"""A point that no symmetry of a shape leaves where it is, near enough to feel small changes."""


def declared(program: Program) -> dict[str, Any]:
    """What a program says of itself: of each parameter its group, when it is visible, its base and its values."""
    return {
        "labels": list(program.labels),
        "constraints": {each.name: each.condition.text for each in program.constraints},
        "apart": [list(pair) for pair in program.apart],
        "elevation": program.view_elevation,
        "parameters": {
            each.name: [each.group, each.visible_if.text if each.visible_if else "", each.base, *each.values]
            for each in program.parameters
        },
    }


def measured(parts: Sequence[Part]) -> list[list[Any]]:
    """Of each part its label, colour, volume, lowest and highest corner."""
    return [[part.label, *part.color, part.mesh.volume, *part.mesh.bounds.ravel().tolist()] for part in parts]


def swept(program: Program, values: Values, name: str) -> list[list[float]]:
    """At each value of the parameter `name`, the others as near to `values` as constraints let them: the volume of the
    whole and the mean distance of its vertices from a point aside; nothing where no others would do."""
    found = []
    for value in program.schema.by_name[name].values:
        changed = repair(program, {**values, name: value}, {name})
        meshes = [part.mesh for part in program.parts(changed)] if changed is not None else []
        away = [np.linalg.norm(mesh.vertices - ASIDE, axis=1) for mesh in meshes]
        found.append([sum(mesh.volume for mesh in meshes), float(np.concatenate(away).mean())] if meshes else [])
    return found


def described(program: Program) -> dict[str, Any]:
    """What stands in the program's file."""
    schema = program.schema
    drawn = [Sampler(program, Share(), off_grid=True).find(None, np.random.default_rng(seed)) for seed in SEEDS]
    return {
        "declared": declared(program),
        "shapes": [
            {
                "values": schema.to_text(values),
                "parts": measured(program.parts(values)),
                "swept": {name: swept(program, values, name) for name in schema.by_name},
            }
            for values in [schema.canonical(schema.base)[0], *drawn]
        ],
    }


def lines(value: Any, depth: int = 4) -> str:
    """JSON with a line for each entry down to `depth`, and eight significant digits."""
    if depth and isinstance(value, dict):
        return "{\n" + ",\n".join(f"{json.dumps(key)}: {lines(each, depth - 1)}" for key, each in value.items()) + "\n}"
    if depth and isinstance(value, list):
        return "[\n" + ",\n".join(lines(each, depth - 1) for each in value) + "\n]"
    return json.dumps(json.loads(json.dumps(value), parse_float=lambda text: float(f"{float(text):.8g}") + 0.0))


if __name__ == "__main__":
    FOLDER.mkdir(parents=True, exist_ok=True)
    for each in program_names():
        (FOLDER / f"{each}.json").write_text(lines(described(find_program(each))) + "\n")
