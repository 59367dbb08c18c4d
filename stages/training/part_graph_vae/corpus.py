"""The shapes of a category as graphs of parts, made ready: read once from the collection."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from pipeline.errors import Rejected
from pipeline.shards import json_bytes
from pipeline.stage import Outcome, Task
from stages.shape.arrays import BoolArray
from stages.shapeassembly.execution.interpreter import Execution, execute
from stages.shapeassembly.extraction.boxes import bounding_box, box_corners, box_gap
from stages.shapeassembly.extraction.hierarchy import Box
from stages.shapeassembly.extraction.validity import MAX_CONNECTED_GAP_SHARE, execution_boxes
from stages.training.box_vectors import BOX_WIDTH, box_vector
from stages.training.part_graph_vae.batches import MAX_CHILDREN, GraphCorpus, GraphNode
from stages.training.program_vae.corpus import category_programs


def prepare_corpus(task: Task) -> Outcome:
    """Files of the shard: `.<split>.safetensors`, the `GraphCorpus` of train and val; `.json`, how many there are.

    Shapes with a node of more than MOST_CHILDREN parts are refused. Raises Rejected where train or val keeps none.
    """
    from safetensors.numpy import save

    params, name = task.shard.params, task.shard.name
    counts: dict[str, dict[str, int]] = {}
    for split in ("train", "val"):
        kept: list[list[GraphNode]] = []
        for key, program in category_programs(task, split):
            try:
                kept.append(graph_nodes(execute(program)))
            except Rejected as error:
                task.reject(key, error.reason, error.detail)
        if not kept:
            raise Rejected(f"{params['kit']} has no shapes of at most {MAX_CHILDREN} parts a node in split {split}")
        graphs = GraphCorpus.of(kept)
        counts[split] = {"shapes": len(graphs), "nodes": len(graphs.boxes), "parts": int(graphs.counts.sum())}
        with task.output(f"{name}.{split}.safetensors") as stream:
            stream.write(save(graphs.arrays()))
    with task.output(f"{name}.json") as stream:
        stream.write(json_bytes({"counts": counts}))
    return Outcome(samples=0, summary=counts)


def read_corpus(task: Task, data: str) -> tuple[dict[str, Any], dict[str, GraphCorpus]]:
    """What `prepare_corpus` wrote in shard `data`: the counts, and the shapes of train and val."""
    from safetensors.numpy import load_file

    described = json.loads(task.input("training", f"{data}.json").read_bytes())
    paths = {split: task.input("training", f"{data}.{split}.safetensors") for split in ("train", "val")}
    return described, {split: GraphCorpus.of_arrays(load_file(path)) for split, path in paths.items()}


def graph_nodes(execution: Execution) -> list[GraphNode]:
    """The nodes of an executed program: an assembly each, its parts the assemblies and cuboids in it, copies among
    them; the box of an assembly is upright and stands around its cuboids. Raises Rejected for too many parts."""
    leaves = execution_boxes(execution)
    reach = MAX_CONNECTED_GAP_SHARE * float(np.linalg.norm(np.ptp(execution.corners.reshape(-1, 3), axis=0)))
    numbers = {path: number for number, path in enumerate(execution.node_names)}
    parts: list[list[tuple[Box, int]]] = [[] for _ in numbers]
    for path, number in list(numbers.items())[1:]:
        within = [box for box, name in zip(leaves, execution.names, strict=True) if name.startswith(f"{path}/")]
        # An assembly whose copies alone are elsewhere has none.
        if within:
            box = bounding_box(np.concatenate([box_corners(each) for each in within]), np.eye(3))
            parts[numbers[path.rpartition("/")[0]]].append((box, number))
    for box, node in zip(leaves, execution.nodes.tolist(), strict=True):
        parts[node].append((box, -1))
    found = []
    for each in parts:
        if len(each) > MAX_CHILDREN:
            raise Rejected("too many parts", f"{len(each)} of one node, at most {MAX_CHILDREN} are learnt")
        boxes = [box for box, _ in each]
        below = np.array([number for _, number in each], np.int64)
        rows = np.array([box_vector(box) for box in boxes]).reshape(-1, BOX_WIDTH)
        found.append(GraphNode(rows, below, touching_boxes(boxes, reach)))
    return found


def touching_boxes(boxes: list[Box], reach: float) -> BoolArray:
    """Which boxes are no further apart than `reach`, bool (n, n); none is itself's neighbour."""
    corners = np.array([box_corners(box) for box in boxes]).reshape(-1, 8, 3)
    low, high = corners.min(axis=1), corners.max(axis=1)
    found: BoolArray = ((low[:, None] <= high + reach) & (low <= high[:, None] + reach)).all(axis=-1)
    upright = [np.allclose(np.abs(box.axes).max(axis=1), 1.0, atol=1e-3) for box in boxes]
    for first, second in np.argwhere(np.triu(found, 1)).tolist():
        if not (upright[first] and upright[second]):
            near = box_gap(boxes[first], boxes[second])[0] <= reach
            found[first, second] = found[second, first] = near
    np.fill_diagonal(found, False)
    return found
