"""The figure of a kit: its exemplars, and every part type with its number of parts."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import ByteArray
from stages.shape.kit import Assembly, Exemplar, Kit
from stages.shape.shape import kit_shape
from stages.shape.views.camera import Camera
from stages.shape.views.part_colors import part_paint
from stages.shape.views.portrait import portrait
from stages.shape.views.scene import scene_of
from stages.shape.views.sheet import Cell, Section, contact_sheet, picture_png

CELL_PIXELS = 200
FIGURE_COLUMNS = 6
EXEMPLAR_CAMERA = Camera(azimuth=-36.0, elevation=28.0, fov=24.0, margin=0.04)
PART_CAMERA = Camera(azimuth=-36.0, elevation=24.0, fov=24.0, margin=0.12)


def kit_figure(kit: Kit) -> bytes:
    """Return a PNG of the kit: its exemplars, then one picture for each part type, the commonest first.

    A caption gives the type's name, its number of parts in the exemplars and its number of symmetries. The project's
    own rasteriser draws the same bytes on every machine.
    """
    used = np.concatenate([exemplar.assembly.types for exemplar in kit.exemplars])
    counts = np.bincount(used, minlength=len(kit.types))
    commonest = np.argsort(-counts, kind="stable").tolist()
    shown = [_type_cell(kit, index, int(counts[index])) for index in commonest]
    span = FIGURE_COLUMNS // min(max(len(kit.exemplars), 2), 3)
    shapes = [_exemplar_cell(kit, exemplar, span) for exemplar in kit.exemplars]
    rules = sum(len(around) for around in kit.grammar.neighbourhoods.values())
    sections = [
        Section(
            _count(len(shapes), "exemplar"),
            _rows(shapes, FIGURE_COLUMNS // span),
            f"{_count(rules, 'neighbourhood')}, {_count(len(kit.grammar.dockings), 'docking')}",
            span,
        ),
        Section(
            _count(len(shown), "part type"),
            _rows(shown, FIGURE_COLUMNS),
            "number of parts in the exemplars, and symmetries",
        ),
    ]
    return picture_png(contact_sheet(sections, kit.name, CELL_PIXELS))


def _exemplar_cell(kit: Kit, exemplar: Exemplar, span: int) -> Cell:
    size = (CELL_PIXELS * span, min(CELL_PIXELS * span * 3 // 4, CELL_PIXELS * 3))
    shape = kit_shape(kit, exemplar.assembly)
    picture = portrait(scene_of(shape), EXEMPLAR_CAMERA, size, part_paint(shape))
    parts, contacts = len(exemplar.assembly), len(exemplar.assembly.edges)
    return Cell(picture, f"{exemplar.name}: {_count(parts, 'part')}, {_count(contacts, 'contact')}")


def _type_cell(kit: Kit, index: int, count: int) -> Cell:
    part = kit.types[index]
    count_symmetries = len(part.symmetries)
    symmetric = "no symmetry" if count_symmetries == 1 else f"{count_symmetries} symmetries"
    return Cell(_type_picture(kit, index), f"{part.name} × {count}, {symmetric}")


def _type_picture(kit: Kit, index: int) -> ByteArray:
    """Draw a part in its first pose of an exemplar."""
    poses = [exemplar.assembly.poses[exemplar.assembly.types == index] for exemplar in kit.exemplars]
    pose = np.concatenate([*poses, np.eye(4)[None]])[:1]
    alone = Assembly(np.array([index], dtype=np.int16), pose, np.empty((0, 2), dtype=np.int32))
    shape = kit_shape(kit, alone)
    return portrait(scene_of(shape), PART_CAMERA, (CELL_PIXELS, CELL_PIXELS), part_paint(shape))


def _rows(cells: list[Cell], columns: int) -> list[list[Cell]]:
    return [cells[first : first + columns] for first in range(0, len(cells), columns)]


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" + ("" if number == 1 else "s")
