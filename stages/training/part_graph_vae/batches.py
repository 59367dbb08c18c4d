"""Part graphs as arrays, and the batches of a step, grouped by depth."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from stages.shape.arrays import BoolArray, FloatArray
from stages.training.box_vectors import BOX_WIDTH
from stages.training.bucketing import bucket_batches
from stages.training.corpus import ArrayCorpus

MAX_CHILDREN = 12
"""Parts of a node. Ten, as in StructureNet, would exclude some storages and tables."""


@dataclass(frozen=True)
class GraphNode:
    """A node and its k parts.

    boxes: float64 (k, 9), box vectors.
    below: int64 (k,), the node that expands each part, counted breadth first within the shape, or -1.
    touching: bool (k, k).
    """

    boxes: FloatArray
    below: npt.NDArray[np.int64]
    touching: BoolArray


@dataclass(frozen=True)
class GraphCorpus(ArrayCorpus):
    """The shapes of one category and split; nodes breadth first.

    boxes: float32 (nodes, MAX_CHILDREN, 9), box vectors of the parts, 0 at padding.
    counts: int64 (nodes,), number of parts.
    below: int32 (nodes, MAX_CHILDREN), as in GraphNode.
    touching: bool (nodes, MAX_CHILDREN, MAX_CHILDREN).
    first: int64 (shapes + 1,), where the nodes of each shape begin.
    """

    boxes: npt.NDArray[np.float32]
    counts: npt.NDArray[np.int64]
    below: npt.NDArray[np.int32]
    touching: npt.NDArray[np.bool_]
    first: npt.NDArray[np.int64]

    @classmethod
    def of(cls, shapes: Sequence[Sequence[GraphNode]]) -> GraphCorpus:
        """Join the nodes of at least one shape."""
        nodes = [node for shape in shapes for node in shape]
        boxes = np.zeros((len(nodes), MAX_CHILDREN, BOX_WIDTH), np.float32)
        below = np.full((len(nodes), MAX_CHILDREN), -1, np.int32)
        touching = np.zeros((len(nodes), MAX_CHILDREN, MAX_CHILDREN), np.bool_)
        for row, node in enumerate(nodes):
            count = len(node.boxes)
            boxes[row, :count], below[row, :count], touching[row, :count, :count] = (
                node.boxes,
                node.below,
                node.touching,
            )
        counts = np.array([len(node.boxes) for node in nodes])
        return cls(boxes, counts, below, touching, np.cumsum([0, *map(len, shapes)]))

    def __len__(self) -> int:
        return len(self.first) - 1


@dataclass(frozen=True)
class GraphLevel:
    """The n nodes of one depth of all shapes of a batch.

    boxes: float (n, MAX_CHILDREN, 9).
    part_mask: float (n, MAX_CHILDREN), 1 for parts.
    inner: float (n, MAX_CHILDREN), 1 for parts that have parts.
    touching: float (n, MAX_CHILDREN, MAX_CHILDREN).
    opened: int64 (m,), index in nodes x MAX_CHILDREN of the parts that have parts, in the order of the level below.
    """

    boxes: Tensor
    part_mask: Tensor
    inner: Tensor
    touching: Tensor
    opened: Tensor

    def __len__(self) -> int:
        return len(self.boxes)

    def to(self, device: torch.device) -> GraphLevel:
        return GraphLevel(**{name: tensor.to(device, non_blocking=True) for name, tensor in vars(self).items()})


GraphBatch = list[GraphLevel]
"""The levels of some shapes, roots first."""


def batches(graphs: GraphCorpus, size: int, rng: np.random.Generator | None) -> Iterator[GraphBatch]:
    """Yield all shapes once, in batches of similar node count as `bucket_batches`."""
    for shapes in bucket_batches(np.diff(graphs.first), size, rng):
        yield batch_of(graphs, shapes)


def batch_of(graphs: GraphCorpus, shapes: npt.NDArray[np.int64]) -> GraphBatch:
    """Build the levels of some shapes, int64 (n,)."""
    nodes = graphs.first[shapes]
    first = nodes
    levels = []
    while len(nodes):
        inner = graphs.below[nodes] >= 0
        part_mask = np.arange(MAX_CHILDREN) < graphs.counts[nodes][:, None]
        levels.append(
            GraphLevel(
                boxes=torch.from_numpy(graphs.boxes[nodes]),
                part_mask=torch.from_numpy(part_mask.astype(np.float32)),
                inner=torch.from_numpy(inner.astype(np.float32)),
                touching=torch.from_numpy(graphs.touching[nodes].astype(np.float32)),
                opened=torch.from_numpy(np.flatnonzero(inner)),
            )
        )
        row, part = np.nonzero(inner)
        nodes, first = first[row] + graphs.below[nodes[row], part], first[row]
    return levels
