"""Prepare the shapes of a category as part graphs."""

from __future__ import annotations

import numpy as np

from pipeline.errors import Rejected
from pipeline.stage import Outcome, Task
from stages.shape.arrays import BoolArray
from stages.shapeassembly.execution.interpreter import Execution, execute
from stages.shapeassembly.extraction.boxes import bounding_box, box_gap, corners_of_box
from stages.shapeassembly.extraction.hierarchy import Box
from stages.shapeassembly.extraction.validity import MAX_CONNECTED_GAP_SHARE, execution_boxes
from stages.training.box_vectors import BOX_WIDTH, box_vector
from stages.training.corpus import prepare_category
from stages.training.part_graph_vae.batches import MAX_CHILDREN, GraphCorpus, GraphNode


def prepare(task: Task) -> Outcome:
    """Prepare the `GraphCorpus` of train and val. Leaves out shapes with a node of more than MAX_CHILDREN parts."""

    def count(graphs: GraphCorpus) -> dict[str, int]:
        return {"shapes": len(graphs), "nodes": len(graphs.boxes), "parts": int(graphs.counts.sum())}

    limit = f"shapes of at most {MAX_CHILDREN} parts a node"
    return prepare_category(task, lambda _, program: graph_nodes(execute(program)), GraphCorpus.of, count, limit)


def graph_nodes(execution: Execution) -> list[GraphNode]:
    """Return the nodes of an executed program, one an assembly; parts are its assemblies and cuboids, copies included.

    The box of an assembly is upright and bounds its cuboids. Raises Rejected for too many parts.
    """
    leaves = execution_boxes(execution)
    reach = MAX_CONNECTED_GAP_SHARE * float(np.linalg.norm(np.ptp(execution.corners.reshape(-1, 3), axis=0)))
    numbers = {path: number for number, path in enumerate(execution.node_names)}
    parts: list[list[tuple[Box, int]]] = [[] for _ in numbers]
    for path, number in list(numbers.items())[1:]:
        within = [box for box, name in zip(leaves, execution.names, strict=True) if name.startswith(f"{path}/")]
        # An assembly without cuboids gets no box.
        if within:
            box = bounding_box(np.concatenate([corners_of_box(leaf) for leaf in within]), np.eye(3))
            parts[numbers[path.rpartition("/")[0]]].append((box, number))
    for box, node in zip(leaves, execution.nodes.tolist(), strict=True):
        parts[node].append((box, -1))
    nodes = []
    for children in parts:
        if len(children) > MAX_CHILDREN:
            raise Rejected("too many parts", f"{len(children)} of one node, at most {MAX_CHILDREN} are learnt")
        boxes = [box for box, _ in children]
        below = np.array([number for _, number in children], np.int64)
        vectors = np.array([box_vector(box) for box in boxes]).reshape(-1, BOX_WIDTH)
        nodes.append(GraphNode(vectors, below, touching_boxes(boxes, reach)))
    return nodes


def touching_boxes(boxes: list[Box], reach: float) -> BoolArray:
    """Return which boxes are at most `reach` apart, bool (n, n), false on the diagonal."""
    corners = np.array([corners_of_box(box) for box in boxes]).reshape(-1, 8, 3)
    low, high = corners.min(axis=1), corners.max(axis=1)
    touching: BoolArray = ((low[:, None] <= high + reach) & (low <= high[:, None] + reach)).all(axis=-1)
    upright = [np.allclose(np.abs(box.axes).max(axis=1), 1.0, atol=1e-3) for box in boxes]
    for first, second in np.argwhere(np.triu(touching, 1)).tolist():
        if not (upright[first] and upright[second]):
            near = box_gap(boxes[first], boxes[second])[0] <= reach
            touching[first, second] = touching[second, first] = near
    np.fill_diagonal(touching, False)
    return touching
