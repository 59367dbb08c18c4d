"""`preview.png`: what the dataset holds, on one sheet: exemplars, shapes, and some shapes' points and sketches."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from pipeline.shards import bytes_array, read_shard
from pipeline.stage import Outcome, Task
from stages.package.settings import PackageConfig
from stages.shape.arrays import ByteArray
from stages.shape.collection.shapes import Collection
from stages.shape.kit import Assembly, Kit
from stages.shape.sample import Sample
from stages.shape.shape import Shape, kit_shape, upright
from stages.shape.views.buffers import Backend
from stages.shape.views.camera import Camera
from stages.shape.views.portrait import points_portrait, portrait
from stages.shape.views.probe import backend_for
from stages.shape.views.scene import scene_of
from stages.shape.views.sheet import Cell, Section, contact_sheet, picture_png
from stages.sketches.settings import SketchesConfig

__all__ = ["draw_preview", "varied"]

COLUMNS = 8
CELL = 232
EXEMPLARS = 16
"""At most so many exemplars are shown."""
MARK = 12
"""What differs from the background by more than so many levels is something shown."""
PAD = 0.02
"""Height of the strip left above and below what a row shows, as a share of the pictures' height."""
CHOSEN_FROM = 512
"""At most so many shapes, evenly spread over the samples, are looked at to choose those that are shown."""
ABOVE = Camera(azimuth=-40.0, elevation=25.0)
BELOW = replace(ABOVE, elevation=-ABOVE.elevation)
"""Where the first sketch looks from below, as at a ceiling lamp, so does the sheet."""


def draw_preview(task: Task) -> Outcome:
    """File of the shard: `.png`. Its params: `title`, `of` how many samples, and the `shards` to choose from.

    The first row of shapes, the points and the sketches show the same shapes, one a column.
    """
    config, sketches = task.config.section(PackageConfig), task.config.section(SketchesConfig)
    backend = backend_for(sketches.backend)
    camera = BELOW if sketches.views[0].elevation < 0 else ABOVE
    collection, shards = Collection(task), task.shard.params["shards"]
    made = {stage: _members(task, stage, shards) for stage in ("points", "sketches")}
    samples = [each for shard in shards for each in collection.samples(shard)]
    whole = [each for each in samples if all(each.key in members for members in made.values())]
    whole = whole[:: -(-len(whole) // CHOSEN_FROM)]
    shown = varied([(each, collection.shape(each)) for each in whole], config.previewed)
    columns = [sample.key for sample, _ in shown[:COLUMNS]]
    clouds = {key: {name: bytes_array(made["points"][key][name]) for name in _CLOUD} for key in columns}
    variants = [Cell(_picture(shape, camera, backend), _size(shape)) for _, shape in shown]
    points = [Cell(_cloud_picture(clouds[key], camera)) for key in columns]
    drawings = [Cell(_decoded(made["sketches"][key]["sketch0.png"])) for key in columns]
    count = len(clouds[columns[0]]["points.npy"])
    exemplars = [Section("Exemplars", _rows(_exemplars(list(collection.kits.values()), backend)), "what goes in")]
    sections = [
        *(exemplars if collection.kits else []),
        Section("Shapes", _rows(variants), f"what comes out: {len(shown)} of {task.shard.params['of']:,}"),
        Section("Points", _rows(points), f"{count:,} a shape, coloured by part label"),
        Section("Sketches", _rows(drawings), f"{len(sketches.views)} a shape, {sketches.size} × {sketches.size}"),
    ]
    with task.output(f"{task.shard.name}.png") as stream:
        stream.write(picture_png(contact_sheet(sections, task.shard.params["title"], CELL)))
    return Outcome(samples=0)


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


_CLOUD = ("points.npy", "labels.npy")


def _members(task: Task, stage: str, shards: Sequence[str]) -> dict[str, dict[str, bytes]]:
    return {key: members for shard in shards for key, members in read_shard(task.input(stage, f"{shard}.tar"))}


def _exemplars(kits: Sequence[Kit], backend: Backend) -> list[Cell]:
    """Exemplars of all kits; where they leave room in their row, the commonest part types of the kits as well."""
    exemplars = [(each.name, kit_shape(kit, each.assembly)) for kit in kits for each in kit.exemplars][:EXEMPLARS]
    cells = [Cell(_picture(shape, ABOVE, backend), f"{name}, {_size(shape)}") for name, shape in exemplars]
    room = -len(cells) % COLUMNS
    return [*cells, *_part_types(kits, room, backend)]


def _part_types(kits: Sequence[Kit], count: int, backend: Backend) -> list[Cell]:
    cells = []
    for kit in kits:
        used = np.concatenate([each.assembly.types for each in kit.exemplars])
        commonest = np.argsort(-np.bincount(used, minlength=len(kit.types)), kind="stable")
        for index in commonest[: -(-count // len(kits))].tolist():
            exemplar = next(each.assembly for each in kit.exemplars if index in each.assembly.types)
            pose = exemplar.poses[exemplar.types == index][:1]
            alone = Assembly(np.array([index], dtype=np.int16), pose, np.empty((0, 2), dtype=np.int32))
            cells.append(Cell(_picture(kit_shape(kit, alone), ABOVE, backend), f"part {kit.types[index].name}"))
    return cells[:count]


def _picture(shape: Shape, camera: Camera, backend: Backend) -> ByteArray:
    return portrait(scene_of(upright(shape)), camera, (CELL, CELL), backend=backend)


def _cloud_picture(cloud: Mapping[str, np.ndarray], camera: Camera) -> ByteArray:
    return points_portrait(
        cloud["points.npy"].astype(np.float64), cloud["labels.npy"].astype(np.int32), camera, (CELL, CELL), "y"
    )


def _decoded(png: bytes) -> ByteArray:
    from PIL import Image

    return np.asarray(Image.open(io.BytesIO(png)).convert("L"))


def _size(shape: Shape) -> str:
    return f"{len(shape)} part" + ("" if len(shape) == 1 else "s")


def _rows(cells: Sequence[Cell]) -> list[list[Cell]]:
    """The cells in rows, each row without the empty strips above and below its pictures."""
    return [_trimmed(cells[start : start + COLUMNS]) for start in range(0, len(cells), COLUMNS)]


def _trimmed(row: Sequence[Cell]) -> list[Cell]:
    """The same strip of every picture of a row, a little higher than what is shown in the fullest."""
    tops, ends = [], []
    for cell in row:
        height = len(cell.picture)
        marked = (np.abs(cell.picture.astype(np.int16) - cell.picture[0, 0]) > MARK).reshape(height, -1).any(axis=1)
        shown = np.flatnonzero(marked)
        tops.append(shown[0] / height if len(shown) else 0.5)
        ends.append((shown[-1] + 1) / height if len(shown) else 0.5)
    top, end = max(min(tops) - PAD, 0.0), min(max(ends) + PAD, 1.0)
    return [
        Cell(cell.picture[round(top * len(cell.picture)) : round(end * len(cell.picture))], cell.caption)
        for cell in row
    ]
