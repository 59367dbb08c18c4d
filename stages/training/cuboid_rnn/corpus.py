"""The shapes of a category as sequences of cuboids, made ready: read once from the collection."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from pipeline.errors import Rejected
from pipeline.shards import json_bytes
from pipeline.stage import Outcome, Task
from stages.shape.arrays import FloatArray
from stages.shapeassembly.execution.interpreter import execute
from stages.shapeassembly.extraction.hierarchy import Box
from stages.shapeassembly.extraction.validity import execution_boxes
from stages.training.box_vectors import CENTRE, SIZE, box_vector
from stages.training.cuboid_rnn.batches import MAX_BOXES, CuboidCorpus
from stages.training.program_vae.corpus import category_programs

MIRROR_TOLERANCE = 0.02
"""Cuboids whose numbers differ by at most so much from a mirror image are one."""


def prepare_corpus(task: Task) -> Outcome:
    """Files of the shard: `.<split>.safetensors`, the `CuboidCorpus` of train and val; `.json`, how many there are.

    Shapes of more than MOST_BOXES cuboids, mirror images counted once, are refused. Raises Rejected where train or val
    keeps none.
    """
    from safetensors.numpy import save

    params, name = task.shard.params, task.shard.name
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
            raise Rejected(f"{params['kit']} has no shapes of at most {MAX_BOXES} cuboids in split {split}")
        cuboids = CuboidCorpus.of(kept)
        counts[split] = {"shapes": len(cuboids), "cuboids": len(cuboids.rows)}
        with task.output(f"{name}.{split}.safetensors") as stream:
            stream.write(save(cuboids.arrays()))
    with task.output(f"{name}.json") as stream:
        stream.write(json_bytes({"counts": counts}))
    return Outcome(samples=0, summary=counts)


def read_corpus(task: Task, data: str) -> tuple[dict[str, Any], dict[str, CuboidCorpus]]:
    """What `prepare_corpus` wrote in shard `data`: the counts, and the shapes of train and val."""
    from safetensors.numpy import load_file

    described = json.loads(task.input("training", f"{data}.json").read_bytes())
    paths = {split: task.input("training", f"{data}.{split}.safetensors") for split in ("train", "val")}
    return described, {split: CuboidCorpus.of_arrays(load_file(path)) for split, path in paths.items()}


def cuboid_rows(boxes: Sequence[Box]) -> FloatArray:
    """The cuboids of a shape, float64 (n, 10): their numbers, and whether each stands there mirrored left to right,
    too; bottom to top, left to right, back to front."""
    numbers = np.stack([box_vector(box) for box in boxes])
    left: set[int] = set()
    pairs = np.zeros(len(numbers))
    images = mirror_cuboids(numbers)
    for row in np.flatnonzero(numbers[:, 0] > MIRROR_TOLERANCE).tolist():
        alike = np.abs(numbers - images[row]).max(axis=1) <= MIRROR_TOLERANCE
        free = [each for each in np.flatnonzero(alike).tolist() if each not in left]
        if free:
            left.add(free[0])
            pairs[row] = 1
    kept = np.concatenate([numbers, pairs[:, None]], axis=1)[[row for row in range(len(numbers)) if row not in left]]
    places, sizes = np.round(kept[:, CENTRE], 2), np.round(kept[:, SIZE], 2)
    found: FloatArray = kept[np.lexsort((*sizes.T, places[:, 2], places[:, 0], places[:, 1]))]
    return found


def mirror_cuboids(numbers: FloatArray) -> FloatArray:
    """The numbers (n, 9) of cuboids mirrored left to right."""
    found: FloatArray = numbers * np.array([-1, 1, 1, 1, 1, 1, 1, -1, -1])
    return found
