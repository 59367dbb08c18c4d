"""Contact sheets of a program: shapes side by side, and one row per parameter with its values across."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from stages.programs.description import parameter_range, value_text
from stages.programs.parameters import Parameter, Value
from stages.programs.program import Program, build_shape
from stages.programs.repair import repair
from stages.programs.schema import Values
from stages.shape.arrays import ByteArray
from stages.shape.views.camera import Camera
from stages.shape.views.portrait import portrait
from stages.shape.views.scene import scene_of
from stages.shape.views.sheet import Cell, Section, contact_sheet

VIEW_AZIMUTH = 35.0
CELL_SIDE_PIXELS = 200
SHAPES_PER_ROW, VALUES_PER_ROW = 8, 15


def shape_picture(program: Program, values: Values, camera: Camera | None = None) -> ByteArray:
    """Draw the shape at `values`, uint8 (side, side, 3), with equal bytes on every machine; obliquely by default."""
    camera = camera or Camera(azimuth=VIEW_AZIMUTH, elevation=program.view_elevation)
    return portrait(scene_of(build_shape(program, values)), camera, (CELL_SIDE_PIXELS, CELL_SIDE_PIXELS))


def shape_sheet(program: Program, shapes: Sequence[Values], captions: Sequence[str], title: str) -> ByteArray:
    """Draw shapes in rows, with a caption under each."""
    cells = [Cell(shape_picture(program, values), caption) for values, caption in zip(shapes, captions, strict=True)]
    rows = [cells[first : first + SHAPES_PER_ROW] for first in range(0, len(cells), SHAPES_PER_ROW)]
    return contact_sheet([Section("", rows)], title, CELL_SIDE_PIXELS)


def parameter_sheet(program: Program) -> ByteArray:
    """Draw one row per parameter: the base shape with each of its values.

    Other parameters change only as needed for visibility and the constraints.
    """
    sections = []
    for parameter in program.parameters:
        shown = values_showing(program, parameter)
        cells = []
        for value in parameter.values:
            values = repair(program, {**shown, parameter.name: value}, {parameter.name})
            if values is not None:
                cells.append(Cell(shape_picture(program, values), value_text(value)))
        rows = [cells[first : first + VALUES_PER_ROW] for first in range(0, len(cells), VALUES_PER_ROW)]
        visible = f", visible where {parameter.visible_if.text}" if parameter.visible_if else ""
        note = f"{parameter.description} {parameter_range(parameter)}{visible}"
        sections.append(Section(parameter.name, rows, note))
    return contact_sheet(sections, f"{program.name}: {len(program.parameters)} parameters", CELL_SIDE_PIXELS)


def values_showing(program: Program, parameter: Parameter) -> dict[str, Value]:
    """The base values with the fewest changes that make `parameter` visible, repaired to satisfy the constraints.

    Raises ValueError where nothing makes it visible.
    """
    schema = program.schema
    deciding = _deciding_parameters(program, parameter)
    for count in range(len(deciding) + 1):
        for names in itertools.combinations(deciding, count):
            for values in itertools.product(*(schema.by_name[name].values for name in names)):
                changed = repair(program, {**schema.base, **dict(zip(names, values, strict=True))})
                if changed is not None and parameter.name in schema.canonical(changed)[1]:
                    return changed
    raise ValueError(f"{program.name}: nothing makes {parameter.name} visible")


def _deciding_parameters(program: Program, parameter: Parameter) -> list[str]:
    """The parameters that the visibility of `parameter` depends on, directly or indirectly."""
    deciding: dict[str, None] = {}
    waiting = [parameter]
    while waiting:
        condition = waiting.pop().visible_if
        for name in condition.names if condition else ():
            if name not in deciding:
                deciding[name] = None
                waiting.append(program.schema.by_name[name])
    return list(deciding)
