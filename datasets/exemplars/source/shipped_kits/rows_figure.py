"""The figure of models with longer and shorter rows: datasets/exemplars/rows.png."""

from __future__ import annotations

import tempfile
from pathlib import Path

from pipeline.randomness import decision_rng
from shipped_kits import rows
from shipped_kits.kit_shape import KitShape, glb_bytes
from stages import api
from stages.proportions.draws import drawn_layouts
from stages.proportions.settings import ProportionsConfig
from stages.proportions.text import ProportionShapes
from stages.rows.settings import RowsConfig
from stages.shape.shape import Shape, part_count
from stages.shape.views.camera import Camera
from stages.shape.views.portrait import portrait
from stages.shape.views.scene import scene_of
from stages.shape.views.sheet import Cell, Section, contact_sheet, picture_png, trimmed

VARIANT_COUNT = 8
CELL_PIXELS = 176
CAMERA = Camera(azimuth=-32.0, elevation=20.0)
RANDOM_SEED = 1


def rows_figure() -> bytes:
    """Draw each model and VARIANT_COUNT of it, as `configs/rows.yaml` makes them, as a PNG."""
    sections = [_section(name, model) for name, model in rows.shapes().items()]
    return picture_png(contact_sheet(sections, "Longer and shorter rows", CELL_PIXELS))


def _section(name: str, model: KitShape) -> Section:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{name}.glb"
        path.write_bytes(glb_bytes(model))
        kit = api.read_kit(path, name, up="y", hubs={"types": "none"}, disconnected="error")
    shapes, exemplar = ProportionShapes(kit), kit.exemplars[0].name
    layouts = drawn_layouts(
        shapes,
        exemplar,
        ProportionsConfig.model_validate({"require": {"stable": True}}),
        RowsConfig(use=True, size="grow"),
        VARIANT_COUNT,
        lambda number: decision_rng(RANDOM_SEED, name, number),
        lambda reason, count: None,
    )
    shown = [shapes.unwarped(exemplar, ()).shape, *(layout.unwarped.shape for layout in layouts)]
    return Section(name, [trimmed([_cell(shape) for shape in shown])], "the model, then variants")


def _cell(shape: Shape) -> Cell:
    return Cell(portrait(scene_of(shape), CAMERA, (CELL_PIXELS, CELL_PIXELS)), part_count(shape))
