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
from stages.training.box_vectors import CENTER, SIZE, box_vector
from stages.training.corpus import category_programs, write_arrays, write_description
from stages.training.cuboid_rnn.batches import MAX_BOXES, CuboidCorpus

MIRROR_TOLERANCE = 0.02
"""Two cuboids are a mirrored pair if no number differs by more from the mirror image."""


def prepare(task: Task) -> Outcome:
    """Write `.<split>.safetensors`, the `CuboidCorpus` of train and val, and `.json`, their counts.

    Rejects shapes of more than MAX_BOXES cuboids. Raises Rejected where a split keeps none.
    """
    counts: dict[str, dict[str, int]] = {}
    for split in ("train", "val"):
        kept: list[FloatArray] = []
        for key, program in category_programs(task, split):
            rows = cuboid_rows(execution_boxes(execute(program)))
            if len(rows) > MAX_BOXES:
                task.reject(key, "too many cuboids", f"{len(rows)}, at most {MAX_BOXES} are learnt")
                continue
            kept.append(rows)
        if not kept:
            kit = task.shard.params["kit"]
            raise Rejected(f"{kit} has no shapes of at most {MAX_BOXES} cuboids in split {split}")
        cuboids = CuboidCorpus.of(kept)
        counts[split] = {"shapes": len(cuboids), "cuboids": len(cuboids.rows)}
        write_arrays(task, f"{task.shard.name}.{split}.safetensors", cuboids.arrays())
    write_description(task, {"counts": counts})
    return Outcome(samples=0, summary=counts)


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
