"""The samples of a shard of the collection, and the shape of each, whatever made it."""

from __future__ import annotations

from collections.abc import Iterator

from pipeline.stage import Task
from stages.shape.collection.shards import KIT_PRODUCER, producer_of
from stages.shape.kit_input import input_kits
from stages.shape.sample import Sample, read_samples
from stages.shape.shape import Shape, kit_shape, upright

__all__ = ["Collection", "text_shape"]


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
        if self.producer == KIT_PRODUCER:
            return upright(kit_shape(self.kits[sample.kit], sample.assembly))
        return text_shape(self.producer, sample.kit, sample.text)


def text_shape(producer: str, kit: str, text: str) -> Shape:
    """The shape that a sample's own text makes, upright: of the program `kit` at parameters, or of a ShapeAssembly
    program. Raises what the producer raises for a text that is none of its own."""
    if producer == "programs":
        from stages.programs.program import shape_of_text

        return upright(shape_of_text(kit, text))
    if producer == "shapeassembly":
        from stages.shapeassembly.shape import shape_of_text as shape_of_program_text

        return upright(shape_of_program_text(text))
    raise ValueError(f"no producer {producer!r} makes shapes of text")
