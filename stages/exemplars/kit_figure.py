"""The figure of a kit: its exemplars, and its commonest part types with their numbers of parts."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from pipeline.errors import ShardFailed
from stages.shape.arrays import ByteArray
from stages.shape.kit import Assembly, Exemplar, Kit
from stages.shape.shape import Shape, kit_shape
from stages.shape.views.camera import Camera
from stages.shape.views.palette import PAPER
from stages.shape.views.part_colors import part_paint
from stages.shape.views.portrait import portrait
from stages.shape.views.scene import scene_of
from stages.shape.views.sheet import Cell, Section, contact_sheet, picture_png
from stages.shape.views.viewpoint import best_viewpoint

CELL_PIXELS = 200
FIGURE_COLUMNS = 6
MAX_TYPES_SHOWN = 120
"""Part types that are drawn, so that a picture of thousands is drawn in seconds and can be opened."""
EXEMPLAR_CAMERA = Camera(azimuth=-40.0, elevation=25.0, fov=24.0, margin=0.04)
PART_MARGIN = 0.12
PART_ELEVATION = 25.0
PART_TURNS = (0.0, 50.0, 100.0, 150.0)
"""Degrees by which the camera is turned about a part until it sees something of it."""


def kit_figure(kit: Kit) -> bytes:
    """Return a PNG of the kit: its exemplars, then one picture for each of the commonest part types.

    Exemplars of one colour are shown twice: as they are, and by the labels of their parts. All are seen from where most
    of the exemplars' parts are seen.
    A caption gives the type's name, its number of parts in the exemplars and its number of symmetries. The project's
    own rasteriser draws the same bytes on every machine.
    """
    used = np.concatenate([exemplar.assembly.types for exemplar in kit.exemplars])
    counts = np.bincount(used, minlength=len(kit.types))
    commonest = np.argsort(-counts, kind="stable")[:MAX_TYPES_SHOWN].tolist()
    wholes = [kit_shape(kit, exemplar.assembly) for exemplar in kit.exemplars]
    camera = best_viewpoint([scene_of(shape) for shape in wholes], EXEMPLAR_CAMERA)
    part_camera = replace(camera, margin=PART_MARGIN, elevation=PART_ELEVATION)
    shown = [_type_cell(kit, index, int(counts[index]), part_camera) for index in commonest]
    paints = [part_paint(shape) for shape in wholes]
    pictures = len(wholes) + sum(paint is not None for paint in paints)
    span = FIGURE_COLUMNS // min(max(pictures, 2), 3)
    shapes = [
        _exemplar_cell(exemplar, shape, span, camera, colors)
        for exemplar, shape, paint in zip(kit.exemplars, wholes, paints, strict=True)
        for colors in ([None] if paint is None else [None, paint])
    ]
    rules = sum(len(around) for around in kit.grammar.neighbourhoods.values())
    sections = [
        Section(
            _count(len(wholes), "exemplar"),
            _rows(shapes, FIGURE_COLUMNS // span),
            f"{_count(rules, 'neighbourhood')}, {_count(len(kit.grammar.dockings), 'docking')}",
            span,
        ),
        Section(
            _count(len(kit.types), "part type"),
            _rows(shown, FIGURE_COLUMNS),
            ("" if len(shown) == len(kit.types) else f"the {len(shown)} commonest; ")
            + "number of parts in the exemplars, and symmetries",
        ),
    ]
    return picture_png(contact_sheet(sections, kit.name, CELL_PIXELS))


def _exemplar_cell(exemplar: Exemplar, shape: Shape, span: int, camera: Camera, colors: ByteArray | None) -> Cell:
    size = (CELL_PIXELS * span, min(CELL_PIXELS * span * 3 // 4, CELL_PIXELS * 3))
    picture = portrait(scene_of(shape), camera, size, colors)
    if colors is not None:
        return Cell(picture, "by part type")
    parts, contacts = len(exemplar.assembly), len(exemplar.assembly.edges)
    return Cell(picture, f"{exemplar.name}: {_count(parts, 'part')}, {_count(contacts, 'contact')}")


def _type_cell(kit: Kit, index: int, count: int, camera: Camera) -> Cell:
    part = kit.types[index]
    count_symmetries = len(part.symmetries)
    symmetric = "no symmetry" if count_symmetries == 1 else f"{count_symmetries} symmetries"
    return Cell(_type_picture(kit, index, camera), f"{part.name} × {count}, {symmetric}")


def _type_picture(kit: Kit, index: int, camera: Camera) -> ByteArray:
    """Draw a part in its first pose of an exemplar, from further round where a thin part is edge-on; a sliver that is
    seen from nowhere is an empty picture.
    """
    poses = [exemplar.assembly.poses[exemplar.assembly.types == index] for exemplar in kit.exemplars]
    pose = np.concatenate([*poses, np.eye(4)[None]])[:1]
    alone = Assembly(np.array([index], dtype=np.int16), pose, np.empty((0, 2), dtype=np.int32))
    shape = kit_shape(kit, alone)
    scene, paint = scene_of(shape), part_paint(shape)
    for turn in PART_TURNS:
        with suppress(ShardFailed):
            return portrait(scene, replace(camera, azimuth=camera.azimuth + turn), (CELL_PIXELS, CELL_PIXELS), paint)
    return np.full((CELL_PIXELS, CELL_PIXELS, 3), PAPER, dtype=np.uint8)


def _rows(cells: list[Cell], columns: int) -> list[list[Cell]]:
    return [cells[first : first + columns] for first in range(0, len(cells), columns)]


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" + ("" if number == 1 else "s")
