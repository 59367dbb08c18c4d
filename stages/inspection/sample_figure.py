"""A figure of what a kit can become: its exemplars, then the most different hits."""

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
FIGURE_COLUMNS = 4
CELL_PIXELS = 300
CAMERA = Camera(azimuth=-40.0, elevation=25.0)


def sample_figure(kit: Kit, shapes: Sequence[Shape], heading: str, title: str, note: str) -> bytes:
    """Return a PNG of the exemplars of a kit and of at most MAX_SHAPES_SHOWN `shapes`, under `heading`."""
    exemplars = [_cell(kit_shape(kit, exemplar.whole), exemplar.name) for exemplar in kit.exemplars]
    cells = [_cell(shape, part_count(shape)) for shape in shapes[:MAX_SHAPES_SHOWN]]
    sections = [Section("Exemplars", _rows(exemplars), "input")]
    if cells:
        sections.append(Section(heading, _rows(cells), note))
    return picture_png(contact_sheet(sections, title, CELL_PIXELS))


def _cell(shape: Shape, caption: str) -> Cell:
    shape = upright(shape)
    return Cell(portrait(scene_of(shape), CAMERA, (CELL_PIXELS, CELL_PIXELS), part_paint(shape)), caption)


def _rows(cells: list[Cell]) -> list[list[Cell]]:
    return [cells[first : first + FIGURE_COLUMNS] for first in range(0, len(cells), FIGURE_COLUMNS)]
