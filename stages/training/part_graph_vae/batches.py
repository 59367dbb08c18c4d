"""The part graphs that a model learns from, by numbers, and the batches of a step: nodes of one level together."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from stages.shape.arrays import BoolArray, FloatArray
from stages.training.box_vectors import BOX_WIDTH
from stages.training.bucketing import bucket_batches

MAX_CHILDREN = 12
"""Parts of a node. With ten, as StructureNet has, some storages and tables would be missing."""


@dataclass(frozen=True)
class GraphNode:
    """One node and its parts. boxes: float64 (k, 9), their numbers; below: int64 (k,), the node that says the parts of
    each, counted within the shape, root first, breadth first, or -1; touching: bool (k, k)."""

    boxes: FloatArray
    below: npt.NDArray[np.int64]
    touching: BoolArray


@dataclass(frozen=True)
class GraphCorpus:
    """Shapes of one category and split, their nodes behind each other, root first, breadth first.

    boxes: float32 (nodes, MOST_CHILDREN, 9), the numbers of their parts, 0 behind the last; counts: int64 (nodes,);
    below: int32 (nodes, MOST_CHILDREN), as in Node; touching: bool (nodes, MOST_CHILDREN, MOST_CHILDREN); first: int64
    (shapes + 1,), where the nodes of each begin.
    """

    boxes: npt.NDArray[np.float32]
    counts: npt.NDArray[np.int64]
    below: npt.NDArray[np.int32]
    touching: npt.NDArray[np.bool_]
    first: npt.NDArray[np.int64]

    @classmethod
    def of(cls, shapes: Sequence[Sequence[GraphNode]]) -> GraphCorpus:
        """At least one shape."""
        nodes = [node for shape in shapes for node in shape]
        boxes = np.zeros((len(nodes), MAX_CHILDREN, BOX_WIDTH), np.float32)
        below = np.full((len(nodes), MAX_CHILDREN), -1, np.int32)
        touching = np.zeros((len(nodes), MAX_CHILDREN, MAX_CHILDREN), np.bool_)
        for row, node in enumerate(nodes):
            many = len(node.boxes)
            boxes[row, :many], below[row, :many], touching[row, :many, :many] = node.boxes, node.below, node.touching
        counts = np.array([len(node.boxes) for node in nodes])
        return cls(boxes, counts, below, touching, np.cumsum([0, *map(len, shapes)]))

    @classmethod
    def of_arrays(cls, arrays: Mapping[str, npt.NDArray[Any]]) -> GraphCorpus:
        return cls(**{name: arrays[name] for name in cls.__dataclass_fields__})

    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """The arrays by name."""
        return dict(vars(self))

    def __len__(self) -> int:
        return len(self.first) - 1


@dataclass(frozen=True)
class GraphLevel:
    """The nodes of one depth of all shapes of a batch.

    boxes: float (n, MOST_CHILDREN, 9); there, inner: float (n, MOST_CHILDREN), 1 for parts, and for those that have
    parts; touching: float (n, MOST_CHILDREN, MOST_CHILDREN); opened: int64 (m,), which in nodes x parts those are that
    have parts, in the order of the nodes of the level below.
    """

    boxes: Tensor
    there: Tensor
    inner: Tensor
    touching: Tensor
    opened: Tensor

    def to(self, device: torch.device) -> GraphLevel:
        return GraphLevel(**{name: tensor.to(device, non_blocking=True) for name, tensor in vars(self).items()})


GraphBatch = list[GraphLevel]
"""The levels of some shapes, the roots first."""


def batches(graphs: GraphCorpus, size: int, rng: np.random.Generator | None) -> Iterator[GraphBatch]:
    """All shapes once, in random order and in batches of shapes of like many nodes; with no `rng`, in their order."""
    for rows in bucket_batches(np.diff(graphs.first), size, rng):
        yield batch_of(graphs, rows)


def batch_of(graphs: GraphCorpus, rows: npt.NDArray[np.int64]) -> GraphBatch:
    """The levels of some shapes, int64 (n,)."""
    nodes = graphs.first[rows]
    first = nodes
    levels = []
    while len(nodes):
        inner = graphs.below[nodes] >= 0
        there = np.arange(MAX_CHILDREN) < graphs.counts[nodes][:, None]
        levels.append(
            GraphLevel(
                boxes=torch.from_numpy(graphs.boxes[nodes]),
                there=torch.from_numpy(there.astype(np.float32)),
                inner=torch.from_numpy(inner.astype(np.float32)),
                touching=torch.from_numpy(graphs.touching[nodes].astype(np.float32)),
                opened=torch.from_numpy(np.flatnonzero(inner)),
            )
        )
        row, place = np.nonzero(inner)
        nodes, first = first[row] + graphs.below[nodes[row], place], first[row]
    return levels
