"""Contact sheets of a program: shapes side by side, and one row a parameter with its values across."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from stages.programs.parameters import Parameter, Value
from stages.programs.program import Program, shape_of
from stages.programs.recipe import parameter_range, value_text
from stages.programs.repair import repaired
from stages.programs.schema import Values
from stages.shape.arrays import ByteArray
from stages.shape.views.camera import Camera
from stages.shape.views.portrait import portrait
from stages.shape.views.scene import scene_of
from stages.shape.views.sheet import Cell, Section, contact_sheet

AZIMUTH = 35.0
CELL = 200
COLUMNS, WIDE = 8, 15


def shape_picture(program: Program, values: Values, camera: Camera | None = None) -> ByteArray:
    """A portrait of the shape at `values`, uint8 (CELL, CELL, 3), the same bytes on every machine; from half its side
    unless a camera says otherwise."""
    seen = camera or Camera(azimuth=AZIMUTH, elevation=program.elevation)
    return portrait(scene_of(shape_of(program, values)), seen, (CELL, CELL))


def row_sheet(program: Program, shapes: Sequence[Values], captions: Sequence[str], title: str) -> ByteArray:
    """Shapes in rows of eight with a line under each."""
    cells = [Cell(shape_picture(program, values), caption) for values, caption in zip(shapes, captions, strict=True)]
    rows = [cells[first : first + COLUMNS] for first in range(0, len(cells), COLUMNS)]
    return contact_sheet([Section("", rows)], title, CELL)


def parameter_sheet(program: Program) -> ByteArray:
    """One row a parameter: the program's base shape at each of its values, and else changed no more than it takes to
    see the parameter and to keep the constraints."""
    sections = []
    for parameter in program.parameters:
        shown = reveal(program, parameter)
        cells = []
        for value in parameter.values:
            values = repaired(program, {**shown, parameter.name: value}, {parameter.name})
            if values is not None:
                cells.append(Cell(shape_picture(program, values), value_text(value)))
        rows = [cells[first : first + WIDE] for first in range(0, len(cells), WIDE)]
        visible = f", seen where {parameter.visible_if.text}" if parameter.visible_if else ""
        note = f"{parameter.sentence} {parameter_range(parameter)}{visible}"
        sections.append(Section(parameter.name, rows, note))
    return contact_sheet(sections, f"{program.name}: {len(program.parameters)} parameters", CELL)


def reveal(program: Program, parameter: Parameter) -> dict[str, Value]:
    """The base values with the fewest changes by which `parameter` is visible, repaired to the constraints.

    Raises ValueError where it never is.
    """
    schema = program.schema
    asked = _asked(program, parameter)
    for count in range(len(asked) + 1):
        for names in itertools.combinations(asked, count):
            for values in itertools.product(*(schema.by_name[name].values for name in names)):
                changed = repaired(program, {**schema.base, **dict(zip(names, values, strict=True))})
                if changed is not None and parameter.name in schema.settled(changed)[1]:
                    return changed
    raise ValueError(f"{program.name}: nothing makes {parameter.name} visible")


def _asked(program: Program, parameter: Parameter) -> list[str]:
    """The parameters that decide whether `parameter` is visible, directly or not."""
    asked: dict[str, None] = {}
    waiting = [parameter]
    while waiting:
        rule = waiting.pop().visible_if
        for name in rule.names if rule else ():
            if name not in asked:
                asked[name] = None
                waiting.append(program.schema.by_name[name])
    return list(asked)
