"""`preview.png`: what the dataset holds, on one sheet: exemplars, shapes, and some shapes' points and sketches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.shards import read_shard
from pipeline.stage import Outcome, Task
from stages.package.settings import PackageConfig
from stages.shape.arrays import ByteArray
from stages.shape.collection.collection import Collection
from stages.shape.collection.discovery import members
from stages.shape.sample import Sample
from stages.shape.shape import Shape, part_count, upright
from stages.shape.views.buffers import RendererName, renderer_version
from stages.shape.views.camera import Camera
from stages.shape.views.part_colors import part_paint
from stages.shape.views.portrait import portrait
from stages.shape.views.scene import scene_of
from stages.shape.views.sheet import Cell, Section, contact_sheet, picture_png
from stages.sketches.settings import SketchesConfig

PREVIEW_COLUMNS = 8
CELL_PIXELS = 232
EXEMPLAR_MARK_PIXELS = 12
"""What differs from the background by more than so many levels is something shown."""
CELL_PAD_SHARE = 0.02
"""Height of the strip left above and below what a row shows, as a share of the pictures' height."""
MAX_PREVIEW_CANDIDATES = 512
"""At most so many shapes, evenly spread over the samples, are looked at to choose those that are shown."""
ABOVE = Camera(azimuth=-40.0, elevation=25.0)
BELOW = replace(ABOVE, elevation=-ABOVE.elevation)
"""Where the first sketch looks from below, as at a ceiling lamp, so does the sheet."""


def draw_preview(task: Task) -> Outcome:
    """File of the shard: `.png`. Its params: `title`, `of` how many samples, the `shards` to choose from, and the
    stages that have `rows` to show.

    The first row of shapes and the rows of the stages show the same shapes, one a column. The backend that draws the
    sketches draws this picture too.
    """
    params, config = task.shard.params, task.config.section(PackageConfig)
    sketches = task.config.section(SketchesConfig)
    backend = sketches.renderer
    camera = BELOW if sketches.views[0].elevation < 0 else ABOVE
    collection, shards = Collection(task), params["shards"]
    made = {stage: _members(task, stage, shards) for stage in params["rows"]}
    samples = [each for shard in shards for each in collection.samples(shard)]
    whole = [each for each in samples if all(each.key in added for added in made.values())]
    whole = whole[:: -(-len(whole) // MAX_PREVIEW_CANDIDATES)]
    shown = varied([(each, collection.shape(each)) for each in whole], config.previewed)
    variants = [Cell(_picture(shape, camera, backend), part_count(shape)) for _, shape in shown]
    sections = [Section("Shapes", _rows(variants), f"what comes out: {len(shown)} of {params['of']:,}")]
    going_in = [
        Cell(_picture(shape, ABOVE, backend), said) for said, shape in collection.decoder.shown(PREVIEW_COLUMNS)
    ]
    if going_in:
        sections.insert(0, Section("Exemplars", _rows(going_in), "what goes in"))
    for stage, added in made.items():
        row = members()[stage].row
        if row is not None:
            cells = [Cell(row.draw(added[sample.key], camera, CELL_PIXELS)) for sample, _ in shown[:PREVIEW_COLUMNS]]
            sections.append(Section(row.title, _rows(cells), row.caption(task.config)))
    with task.output(f"{task.shard.name}.png") as stream:
        stream.write(picture_png(contact_sheet(sections, params["title"], CELL_PIXELS)))
    return Outcome(samples=0, summary={"renderer": backend, "renderer_version": renderer_version(backend)})


def varied(samples: Sequence[tuple[Sample, Shape]], count: int) -> list[tuple[Sample, Shape]]:
    """`count` samples, or all if there are fewer: the kits take turns, each beginning with its largest sample and
    going on with the one that differs most from those before in how many parts of which label it has."""
    kits = dict.fromkeys(sorted(sample.kit for sample, _ in samples))
    queues = [_farthest([each for each in samples if each[0].kit == kit], count) for kit in kits]
    turns = [queue[turn] for turn in range(count) for queue in queues if turn < len(queue)]
    return turns[:count]


def _farthest(samples: Sequence[tuple[Sample, Shape]], count: int) -> list[tuple[Sample, Shape]]:
    labels = max(len(shape.labels) for _, shape in samples)
    counts = np.array([np.bincount(shape.part_labels, minlength=labels) for _, shape in samples], dtype=np.float64)
    chosen = [int(np.argmax(counts.sum(axis=1)))]
    apart = np.full(len(samples), np.inf)
    while len(chosen) < min(count, len(samples)):
        apart = np.minimum(apart, np.abs(counts - counts[chosen[-1]]).sum(axis=1))
        apart[chosen] = -1.0
        chosen.append(int(np.argmax(apart)))
    return [samples[each] for each in chosen]


def _members(task: Task, stage: str, shards: Sequence[str]) -> dict[str, dict[str, bytes]]:
    return {key: members for shard in shards for key, members in read_shard(task.input(stage, f"{shard}.tar"))}


def _picture(shape: Shape, camera: Camera, backend: RendererName) -> ByteArray:
    return portrait(scene_of(upright(shape)), camera, (CELL_PIXELS, CELL_PIXELS), part_paint(shape), backend)


def _rows(cells: Sequence[Cell]) -> list[list[Cell]]:
    """The cells in rows, each row without the empty strips above and below its pictures."""
    return [_trimmed(cells[start : start + PREVIEW_COLUMNS]) for start in range(0, len(cells), PREVIEW_COLUMNS)]


def _trimmed(row: Sequence[Cell]) -> list[Cell]:
    """The same strip of every picture of a row, a little higher than what is shown in the fullest."""
    tops, ends = [], []
    for cell in row:
        height = len(cell.picture)
        marked = (
            (np.abs(cell.picture.astype(np.int16) - cell.picture[0, 0]) > EXEMPLAR_MARK_PIXELS)
            .reshape(height, -1)
            .any(axis=1)
        )
        shown = np.flatnonzero(marked)
        tops.append(shown[0] / height if len(shown) else 0.5)
        ends.append((shown[-1] + 1) / height if len(shown) else 0.5)
    top, end = max(min(tops) - CELL_PAD_SHARE, 0.0), min(max(ends) + CELL_PAD_SHARE, 1.0)
    return [
        Cell(cell.picture[round(top * len(cell.picture)) : round(end * len(cell.picture))], cell.caption)
        for cell in row
    ]
