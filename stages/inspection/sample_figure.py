"""A sheet of what a kit can become: its exemplars, then the finds that differ most."""

from __future__ import annotations

from collections.abc import Sequence

from stages.shape.kit import Kit
from stages.shape.shape import Shape, kit_shape, part_count, upright
from stages.shape.views.camera import Camera
from stages.shape.views.part_colors import part_paint
from stages.shape.views.portrait import portrait
from stages.shape.views.scene import scene_of
from stages.shape.views.sheet import Cell, Section, contact_sheet, picture_png

MAX_SHAPES_SHOWN = 12
COLUMNS = 4
CELL = 300
CAMERA = Camera(azimuth=-40.0, elevation=25.0)


def sample_figure(kit: Kit, shapes: Sequence[Shape], found: str, title: str, note: str) -> bytes:
    """A PNG of the exemplars of a kit and of at most SHOWN `shapes`; `found`: what these are."""
    whole = [_cell(kit_shape(kit, each.whole), each.name) for each in kit.exemplars]
    cells = [_cell(each, part_count(each)) for each in shapes[:MAX_SHAPES_SHOWN]]
    sections = [Section("Exemplars", _rows(whole), "what goes in")]
    if cells:
        sections.append(Section(found, _rows(cells), note))
    return picture_png(contact_sheet(sections, title, CELL))


def _cell(shape: Shape, caption: str) -> Cell:
    shape = upright(shape)
    return Cell(portrait(scene_of(shape), CAMERA, (CELL, CELL), part_paint(shape)), caption)


def _rows(cells: list[Cell]) -> list[list[Cell]]:
    return [cells[first : first + COLUMNS] for first in range(0, len(cells), COLUMNS)]
