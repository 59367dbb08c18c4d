"""The samples of a shard of the collection, their shapes, and the loop that adds members to them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

from pipeline.errors import Rejected
from pipeline.shards import ShardWriter, read_shard
from pipeline.stage import Task
from stages.shape.collection.classes import Classes
from stages.shape.collection.discovery import language_of
from stages.shape.sample import Sample, read_samples
from stages.shape.shape import Shape, upright


class Collection:
    """What the shard of a task reads of the collection. Shapes are upright, y up: the coordinates of a dataset."""

    def __init__(self, task: Task) -> None:
        self._task = task
        self.producer = str(task.shard.params["producer"])
        self.decoder = language_of(self.producer).decoder(task)
        self.classes = Classes.of(self.decoder.sources)

    def samples(self, shard: str = "") -> Iterator[Sample]:
        """Yield the samples of the collection's shard `shard`, or of the task's own, one in memory at a time."""
        return read_samples(self._task.input(self.producer, f"{shard or self._task.shard.name}.tar"))

    def shape(self, sample: Sample) -> Shape:
        """Return the shape of a sample. The classes of its parts are those of the dataset."""
        shape = upright(self.decoder.shape(sample))
        return replace(shape, class_ids=self.classes.of_kit[sample.kit])


def add_members(task: Task, members_of: Callable[[Collection, Sample], Mapping[str, bytes]]) -> int:
    """Write the shard's tar: for each sample of the collection what `members_of` returns, under the sample's key.

    A sample for which it raises Rejected is rejected and counted. Returns the number of samples written.
    """
    collection, total = Collection(task), int(task.shard.params["samples"])
    with task.output(f"{task.shard.name}.tar") as stream, ShardWriter(stream) as writer:
        for sample in collection.samples():
            try:
                writer.write(sample.key, members_of(collection, sample))
            except Rejected as error:
                task.reject(sample.key, error.reason, error.detail)
            task.progress(writer.samples, total)
    return writer.samples


def stage_members(task: Task, stage: str) -> Callable[[str], Mapping[str, bytes]]:
    """Return a function from the key of a sample to the members that a stage added to it, for the shard of a task.

    Samples are asked for in the order of the collection; one is in memory at a time. The function raises Rejected for
    a sample that the stage rejected.
    """
    samples = read_shard(task.input(stage, f"{task.shard.name}.tar"))
    following = next(samples, None)

    def members_of(key: str) -> Mapping[str, bytes]:
        nonlocal following
        if following is None or following[0] != key:
            raise Rejected(f"rejected by {stage}")
        members = following[1]
        following = next(samples, None)
        return members

    return members_of
