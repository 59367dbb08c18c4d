"""The language of heaps: heights in a text, boxes on top of each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pipeline.paths import DatasetPaths
from stages.shape.collection.language import Language, RebuildShape, Source
from stages.shape.kit import Assembly, PartMesh
from stages.shape.sample import Sample
from stages.shape.shape import Shape, upright

CORNERS = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
SIDES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
FACES = np.array([face for a, b, c, d in SIDES for face in ((a, b, c), (a, c, d))], dtype=np.int32)
LABELS = ("foot", "pebble")


def heap(text: str) -> Shape:
    """The heap of a text."""
    heights = np.array([float(word) for word in text.split()])
    color = np.full((12, 3), 120, np.uint8)
    meshes = tuple(PartMesh(LABELS[min(k, 1)], CORNERS * (1, h, 1), FACES, color) for k, h in enumerate(heights))
    poses = np.tile(np.eye(4), (len(heights), 1, 1))
    poses[1:, 1, 3] = np.cumsum(heights)[:-1]
    return Shape(
        meshes, Assembly(np.arange(len(heights), dtype=np.int16), poses, np.empty((0, 2), np.int32)), "y", LABELS
    )


class Heaps:
    """There is one kind of heap."""

    sources: Mapping[str, Source] = {"heap": Source(LABELS, sentence="of pebbles")}

    def shape(self, sample: Sample) -> Shape:
        """The heap of a sample."""
        return heap(sample.text)

    def shown(self, count: int) -> Sequence[tuple[str, Shape]]:
        """One pebble goes in."""
        return [("a pebble", heap("1.0"))]


def _rebuild(_: DatasetPaths) -> RebuildShape:
    return lambda record, _: upright(heap(record["text"]))


LANGUAGE = Language("heap", lambda _: (), lambda _: Heaps(), False, "Heights of the pebbles.", _rebuild)
