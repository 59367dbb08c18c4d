"""Prepare the shapes of a category as cuboid sequences."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.errors import Rejected
from pipeline.stage import Outcome, Task
from stages.shape.arrays import FloatArray
from stages.shapeassembly.execution.interpreter import execute
from stages.shapeassembly.extraction.hierarchy import Box
from stages.shapeassembly.extraction.validity import execution_boxes
from stages.shapeassembly.syntax.program import AssemblyProgram
from stages.training.box_vectors import CENTER, SIZE, box_vector
from stages.training.corpus import prepare_category
from stages.training.cuboid_rnn.batches import MAX_BOXES, CuboidCorpus

MIRROR_TOLERANCE = 0.02
"""Two cuboids are a mirrored pair if no number differs by more from the mirror image."""


def prepare(task: Task) -> Outcome:
    """Prepare the `CuboidCorpus` of train and val. Leaves out shapes of more than MAX_BOXES cuboids."""

    def convert(key: str, program: AssemblyProgram) -> FloatArray:
        rows = cuboid_rows(execution_boxes(execute(program)))
        if len(rows) > MAX_BOXES:
            raise Rejected("too many cuboids", f"{len(rows)}, at most {MAX_BOXES} are learnt")
        return rows

    def count(cuboids: CuboidCorpus) -> dict[str, int]:
        return {"shapes": len(cuboids), "cuboids": len(cuboids.rows)}

    return prepare_category(task, convert, CuboidCorpus.of, count, f"shapes of at most {MAX_BOXES} cuboids")


def cuboid_rows(boxes: Sequence[Box]) -> FloatArray:
    """Return the cuboids of a shape, float64 (n, 10): box vector, and whether a mirror image left to right exists.

    Order: bottom to top, left to right, back to front.
    """
    vectors = np.stack([box_vector(box) for box in boxes])
    left: set[int] = set()
    mirrored = np.zeros(len(vectors))
    images = mirror_cuboids(vectors)
    for row in np.flatnonzero(vectors[:, 0] > MIRROR_TOLERANCE).tolist():
        matches = np.abs(vectors - images[row]).max(axis=1) <= MIRROR_TOLERANCE
        free = [other for other in np.flatnonzero(matches).tolist() if other not in left]
        if free:
            left.add(free[0])
            mirrored[row] = 1
    right = [row for row in range(len(vectors)) if row not in left]
    kept = np.concatenate([vectors, mirrored[:, None]], axis=1)[right]
    centers, sizes = np.round(kept[:, CENTER], 2), np.round(kept[:, SIZE], 2)
    rows: FloatArray = kept[np.lexsort((*sizes.T, centers[:, 2], centers[:, 0], centers[:, 1]))]
    return rows


def mirror_cuboids(vectors: FloatArray) -> FloatArray:
    """Return box vectors (n, 9) mirrored left to right."""
    mirrored: FloatArray = vectors * np.array([-1, 1, 1, 1, 1, 1, 1, -1, -1])
    return mirrored
