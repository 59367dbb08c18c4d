"""The samples of a shard of the collection, and the shape of each, whatever made it."""

from __future__ import annotations

from collections.abc import Iterator

from pipeline.stage import Task
from stages.collection.shards import producer_of
from stages.shape.kit_input import input_kits
from stages.shape.sample import Sample, read_samples
from stages.shape.shape import Shape, kit_shape, upright

__all__ = ["Collection"]


class Collection:
    """What the shard of a task reads of the collection. Shapes are upright, y up: the coordinates of a dataset."""

    def __init__(self, task: Task) -> None:
        self._task = task
        self.producer = producer_of(task.shard)
        self.kits = input_kits(task)

    def samples(self, shard: str = "") -> Iterator[Sample]:
        """The samples of the collection's shard `shard`, or of the task's own, in order, one in memory at a time."""
        return read_samples(self._task.input(self.producer, f"{shard or self._task.shard.name}.tar"))

    def shape(self, sample: Sample) -> Shape:
        """The shape of a sample."""
        return upright(kit_shape(self.kits[sample.kit], sample.assembly))
