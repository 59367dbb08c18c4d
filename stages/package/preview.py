"""`preview.png`: what the dataset holds, on one sheet: exemplars, variants, and some variants' points and sketches."""

from __future__ import annotations

import io
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from pipeline.shards import bytes_array, read_shard
from pipeline.stage import Outcome, Task
from stages.package.settings import PackageConfig
from stages.shape.arrays import ByteArray
from stages.shape.collection import collection_kits
from stages.shape.kit import Assembly, Kit
from stages.shape.sample import Sample, read_samples
from stages.sketches.settings import SketchesConfig
from stages.views.buffers import Backend, backend_for
from stages.views.camera import Camera
from stages.views.portrait import points_portrait, portrait
from stages.views.scene import scene_of
from stages.views.sheet import Cell, Section, contact_sheet, picture_png

__all__ = ["draw_preview", "varied"]

COLUMNS = 8
CELL = 232
EXEMPLARS = 16
"""At most so many exemplars are shown."""
CAMERA = Camera(azimuth=-40.0, elevation=25.0)


def draw_preview(task: Task) -> Outcome:
    """File of the shard: `.png`. Its params: `title`, all `samples`, and the `shards` to choose from.

    The first row of variants, the points and the sketches show the same shapes, one a column.
    """
    config, sketches = task.config.section(PackageConfig), task.config.section(SketchesConfig)
    backend = backend_for(sketches.backend)
    kits, shards = collection_kits(task), task.shard.params["shards"]
    made = {stage: _members(task, stage, shards) for stage in ("points", "sketches")}
    samples = [each for shard in shards for each in read_samples(task.input("variations", f"{shard}.tar"))]
    whole = [each for each in samples if all(each.key in members for members in made.values())]
    shown = varied(whole, list(kits), config.previewed)
    columns = [each.key for each in shown[:COLUMNS]]
    clouds = {key: {name: bytes_array(made["points"][key][name]) for name in _CLOUD} for key in columns}
    variants = [Cell(_picture(each.assembly, kits[each.kit], backend), _size(each.assembly)) for each in shown]
    points = [Cell(_cloud_picture(clouds[key])) for key in columns]
    drawings = [Cell(_decoded(made["sketches"][key]["sketch0.png"])) for key in columns]
    count = len(clouds[columns[0]]["points.npy"])
    sections = [
        Section("Exemplars", _rows(_exemplars(kits.values(), backend)), "what goes in"),
        Section("Variants", _rows(variants), f"what comes out: {len(shown)} of {task.shard.params['samples']:,}"),
        Section("Points", _rows(points), f"{count:,} a shape, coloured by part type"),
        Section("Sketches", _rows(drawings), f"{len(sketches.views)} a shape, {sketches.size} × {sketches.size}"),
    ]
    with task.output(f"{task.shard.name}.png") as stream:
        stream.write(picture_png(contact_sheet(sections, task.shard.params["title"], CELL)))
    return Outcome(samples=0)


def varied(samples: Sequence[Sample], kits: Sequence[str], count: int) -> list[Sample]:
    """`count` samples, or all if there are fewer: the kits take turns, and of each kit the sizes are spread evenly
    from small to large and come mixed."""
    queues = []
    for kit in kits:
        own = sorted((each for each in samples if each.kit == kit), key=lambda each: (len(each.assembly), each.key))
        wanted = min(len(own), -(-count // len(kits)) if len(own) < len(samples) else count)
        spread = [own[(2 * place + 1) * len(own) // (2 * wanted)] for place in range(wanted)]
        queues.append([spread[place] for place in _mixed(wanted)])
    turns = [queue[turn] for turn in range(count) for queue in queues if turn < len(queue)]
    return turns[:count]


_CLOUD = ("points.npy", "labels.npy")


def _mixed(count: int) -> list[int]:
    """0 to count - 1 in an order whose every stretch covers the whole range: by golden steps."""
    return sorted(range(count), key=lambda place: (place * 0.6180339887498949) % 1.0)


def _members(task: Task, stage: str, shards: Sequence[str]) -> dict[str, dict[str, bytes]]:
    return {key: members for shard in shards for key, members in read_shard(task.input(stage, f"{shard}.tar"))}


def _exemplars(kits: Iterable[Kit], backend: Backend) -> list[Cell]:
    """Exemplars of all kits; where they leave room in their row, the commonest part types of the kits as well."""
    listed = list(kits)
    shown = [(each, kit) for kit in listed for each in kit.exemplars][:EXEMPLARS]
    cells = [Cell(_picture(each.assembly, kit, backend), f"{each.name}, {_size(each.assembly)}") for each, kit in shown]
    room = -len(cells) % COLUMNS
    return [*cells, *_part_types(listed, room, backend)]


def _part_types(kits: Sequence[Kit], count: int, backend: Backend) -> list[Cell]:
    cells = []
    for kit in kits:
        used = np.concatenate([each.assembly.types for each in kit.exemplars])
        commonest = np.argsort(-np.bincount(used, minlength=len(kit.types)), kind="stable")
        for index in commonest[: -(-count // len(kits))].tolist():
            exemplar = next(each.assembly for each in kit.exemplars if index in each.assembly.types)
            pose = exemplar.poses[exemplar.types == index][:1]
            alone = Assembly(np.array([index], dtype=np.int16), pose, np.empty((0, 2), dtype=np.int32))
            cells.append(Cell(_picture(alone, kit, backend), f"part {kit.types[index].name}"))
    return cells[:count]


def _picture(assembly: Assembly, kit: Kit, backend: Backend) -> ByteArray:
    return portrait(scene_of(assembly, kit), CAMERA, (CELL, CELL), backend=backend)


def _cloud_picture(cloud: Mapping[str, np.ndarray]) -> ByteArray:
    return points_portrait(
        cloud["points.npy"].astype(np.float64), cloud["labels.npy"].astype(np.int32), CAMERA, (CELL, CELL), "y"
    )


def _decoded(png: bytes) -> ByteArray:
    from PIL import Image

    return np.asarray(Image.open(io.BytesIO(png)).convert("L"))


def _size(assembly: Assembly) -> str:
    return f"{len(assembly)} parts"


def _rows(cells: Sequence[Cell]) -> list[Sequence[Cell]]:
    return [cells[start : start + COLUMNS] for start in range(0, len(cells), COLUMNS)]
