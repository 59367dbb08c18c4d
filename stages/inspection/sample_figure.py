"""A figure of what a kit can become: its exemplars, some shapes at random, and the most different ones."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from stages.shape.arrays import ByteArray
from stages.shape.kit import Kit
from stages.shape.shape import Shape, kit_shape, part_count, upright
from stages.shape.views.camera import Camera
from stages.shape.views.part_colors import part_paint
from stages.shape.views.portrait import portrait
from stages.shape.views.scene import scene_of
from stages.shape.views.sheet import Cell, Section, contact_sheet, picture_png, trimmed
from stages.shape.views.viewpoint import best_viewpoint

MAX_SHAPES_SHOWN = 12
FIGURE_COLUMNS = 6
CELL_PIXELS = 260
CAMERA = Camera(azimuth=-40.0, elevation=25.0)


@dataclass(frozen=True)
class ShownShape:
    """A shape, and what kind of new shape it is; may be empty."""

    shape: Shape
    kind: str = ""


@dataclass(frozen=True)
class ShownShapes:
    """Shapes under a heading.

    shapes: at most MAX_SHAPES_SHOWN are shown.
    note: small print next to the heading.
    """

    heading: str
    shapes: Sequence[ShownShape]
    note: str = ""


def sample_figure(kit: Kit, groups: Sequence[ShownShapes], title: str) -> bytes:
    """Return a PNG of the exemplars of a kit and of `groups` of shapes, all from where most of the exemplars is seen.

    Exemplars of one colour are shown twice: as they are, and by the labels of their parts.
    """
    wholes = [upright(kit_shape(kit, exemplar.whole)) for exemplar in kit.exemplars]
    camera = best_viewpoint([scene_of(shape) for shape in wholes], CAMERA)
    exemplars = [
        cell
        for exemplar, shape in zip(kit.exemplars, wholes, strict=True)
        for cell in _exemplar_cells(shape, exemplar.name, camera)
    ]
    sections = [Section("Exemplars", _rows(exemplars), "input")]
    for group in groups:
        shown = group.shapes[:MAX_SHAPES_SHOWN]
        cells = [Cell(_picture(upright(example.shape), camera), _caption(example)) for example in shown]
        if cells:
            sections.append(Section(group.heading, _rows(cells), group.note))
    return picture_png(contact_sheet(sections, title, CELL_PIXELS))


def _exemplar_cells(shape: Shape, name: str, camera: Camera) -> Iterator[Cell]:
    yield Cell(_picture(shape, camera), name)
    paint = part_paint(shape)
    if paint is not None:
        yield Cell(portrait(scene_of(shape), camera, (CELL_PIXELS, CELL_PIXELS), paint), "by part type")


def _caption(shown: ShownShape) -> str:
    return f"{part_count(shown.shape)}, {shown.kind}" if shown.kind else part_count(shown.shape)


def _picture(shape: Shape, camera: Camera) -> ByteArray:
    return portrait(scene_of(shape), camera, (CELL_PIXELS, CELL_PIXELS))


def _rows(cells: list[Cell]) -> list[list[Cell]]:
    return [trimmed(cells[first : first + FIGURE_COLUMNS]) for first in range(0, len(cells), FIGURE_COLUMNS)]
