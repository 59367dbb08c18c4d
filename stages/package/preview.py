"""`preview.png`: one sheet with exemplars, shapes, and points and sketches of some shapes."""

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
from stages.shape.views.portrait import portrait
from stages.shape.views.scene import Scene, scene_of
from stages.shape.views.sheet import Cell, Section, contact_sheet, picture_png, trimmed
from stages.shape.views.viewpoint import best_viewpoint
from stages.sketches.settings import SketchesConfig

PREVIEW_COLUMNS = 8
CELL_PIXELS = 232
MAX_PREVIEW_CANDIDATES = 512
"""Number of shapes, evenly spread over the samples, from which the preview is chosen."""
ABOVE = Camera(azimuth=-40.0, elevation=25.0)
BELOW = replace(ABOVE, elevation=-ABOVE.elevation)
"""Used where the first sketch looks from below, as at a ceiling lamp."""


def draw_preview(task: Task) -> Outcome:
    """Write the shard's `.png`, drawn by the renderer of the sketches.

    Params: `title`, `of` (number of samples), `shards` to choose from, and stages with `rows`. The first row of shapes
    and the rows of stages show the same shapes, one per column.
    """
    params, config = task.shard.params, task.config.section(PackageConfig)
    sketches = task.config.section(SketchesConfig)
    backend = sketches.renderer
    camera = BELOW if sketches.views and sketches.views[0].elevation < 0 else ABOVE
    cameras = _Cameras(camera)
    collection, shards = Collection(task), params["shards"]
    keys_by_stage = [_keys(task, stage, shards) for stage in params["rows"]]
    samples = [sample for shard in shards for sample in collection.samples(shard)]
    complete = [sample for sample in samples if all(sample.key in keys for keys in keys_by_stage)]
    complete = complete[:: -(-len(complete) // MAX_PREVIEW_CANDIDATES)]
    chosen = varied([(sample, collection.shape(sample)) for sample in complete], config.previewed)
    for sample, shape in chosen:
        cameras.see(sample.kit, shape)
    variants = [Cell(_picture(shape, cameras.of(sample.kit), backend), part_count(shape)) for sample, shape in chosen]
    sections = [Section("Shapes", _rows(variants), f"{len(chosen)} of {params['of']:,}")]
    exemplars = [
        Cell(_picture(shape, best_viewpoint([scene_of(upright(shape))], ABOVE), backend), caption)
        for caption, shape in collection.decoder.shown(PREVIEW_COLUMNS)
    ]
    if exemplars:
        sections.insert(0, Section("Exemplars", _rows(exemplars), "input"))
    shown = [sample for sample, _ in chosen[:PREVIEW_COLUMNS]]
    for stage in params["rows"]:
        added = _members(task, stage, shards, {sample.key for sample in shown})
        for row in members()[stage].rows(task.config):
            cells = [Cell(row.draw(added[sample.key], cameras.of(sample.kit), CELL_PIXELS)) for sample in shown]
            sections.append(Section(row.title, _rows(cells), row.caption(task.config)))
    with task.output(f"{task.shard.name}.png") as stream:
        stream.write(picture_png(contact_sheet(sections, params["title"], CELL_PIXELS)))
    return Outcome(samples=0, summary={"renderer": backend, "renderer_version": renderer_version(backend)})


class _Cameras:
    """The viewpoint of each kit's pictures, chosen by its first shapes, where pictures are taken from above."""

    def __init__(self, camera: Camera) -> None:
        self._camera = camera
        self._scenes: dict[str, list[Scene]] = {}
        self._chosen: dict[str, Camera] = {}

    def see(self, kit: str, shape: Shape) -> None:
        self._scenes.setdefault(kit, []).append(scene_of(upright(shape)))

    def of(self, kit: str) -> Camera:
        if self._camera.elevation < 0:
            return self._camera
        if kit not in self._chosen:
            self._chosen[kit] = best_viewpoint(self._scenes[kit], self._camera)
        return self._chosen[kit]


def varied(samples: Sequence[tuple[Sample, Shape]], count: int) -> list[tuple[Sample, Shape]]:
    """Choose at most `count` samples, farthest first by the numbers of parts of each label.

    The kits of each producer take turns; each begins with its largest sample.
    """
    kits = dict.fromkeys(sorted((sample.kit, sample.producer) for sample, _ in samples))
    queues = [_farthest([pair for pair in samples if (pair[0].kit, pair[0].producer) == kit], count) for kit in kits]
    turns = [queue[turn] for turn in range(count) for queue in queues if turn < len(queue)]
    return turns[:count]


def _farthest(samples: Sequence[tuple[Sample, Shape]], count: int) -> list[tuple[Sample, Shape]]:
    labels = max(len(shape.labels) for _, shape in samples)
    counts = np.array([np.bincount(shape.part_labels, minlength=labels) for _, shape in samples], dtype=np.float64)
    chosen = [int(np.argmax(counts.sum(axis=1)))]
    distance = np.full(len(samples), np.inf)
    while len(chosen) < min(count, len(samples)):
        distance = np.minimum(distance, np.abs(counts - counts[chosen[-1]]).sum(axis=1))
        distance[chosen] = -1.0
        chosen.append(int(np.argmax(distance)))
    return [samples[index] for index in chosen]


def _keys(task: Task, stage: str, shards: Sequence[str]) -> set[str]:
    return {key for shard in shards for key, _ in read_shard(task.input(stage, f"{shard}.tar"))}


def _members(task: Task, stage: str, shards: Sequence[str], keys: set[str]) -> dict[str, dict[str, bytes]]:
    """Return the members of some samples by key."""
    stored = (item for shard in shards for item in read_shard(task.input(stage, f"{shard}.tar")))
    return {key: members for key, members in stored if key in keys}


def _picture(shape: Shape, camera: Camera, backend: RendererName) -> ByteArray:
    return portrait(scene_of(upright(shape)), camera, (CELL_PIXELS, CELL_PIXELS), renderer=backend)


def _rows(cells: Sequence[Cell]) -> list[list[Cell]]:
    """Arrange cells in rows, without the empty strips above and below their pictures."""
    return [trimmed(cells[start : start + PREVIEW_COLUMNS]) for start in range(0, len(cells), PREVIEW_COLUMNS)]
