"""Clouds of shapes with the part of each point, and how those of a dataset are prepared."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.errors import Rejected
from pipeline.stage import Outcome, Task
from stages.points.area_sampling import sample_shape
from stages.shape.arrays import FloatArray
from stages.shape.collection.collection import Collection
from stages.training.corpus import ArrayCorpus, write_arrays, write_description
from stages.training.recovery.clouds import frame_of, subsample

LEARNT_POINTS = 2048
"""Points of a prepared cloud; training draws from them at each step."""


@dataclass(frozen=True)
class LabelledClouds(ArrayCorpus):
    """Clouds of n shapes, y up, each centred, with a bounding box of diagonal 1.

    points: float32 (n, k, 3).
    parts: the part of each point, int32 (n, k).
    """

    points: npt.NDArray[np.float32]
    parts: npt.NDArray[np.int32]

    @classmethod
    def of(
        cls, clouds: Iterable[tuple[FloatArray, npt.NDArray[np.integer]]], points: int, rng: np.random.Generator
    ) -> LabelledClouds:
        """Return clouds of `points` random points each, centred and of diagonal 1.

        clouds: points float (m, 3), and the part of each, int (m,).
        """
        stacked_points, stacked_parts = [], []
        for cloud, parts in clouds:
            drawn = subsample(np.column_stack([cloud, parts]).astype(np.float64), points, rng)
            stacked_points.append(scaled_to_diagonal(drawn[:, :3]))
            stacked_parts.append(drawn[:, 3].astype(np.int32))
        if not stacked_points:
            return cls(np.empty((0, points, 3), np.float32), np.empty((0, points), np.int32))
        return cls(np.stack(stacked_points), np.stack(stacked_parts))

    @classmethod
    def joined(cls, sets: Sequence[LabelledClouds]) -> LabelledClouds:
        """Join sets of clouds with equally many points."""
        return cls(np.concatenate([s.points for s in sets]), np.concatenate([s.parts for s in sets]))

    def __len__(self) -> int:
        return len(self.points)

    def chosen(self, shapes: npt.NDArray[np.integer]) -> LabelledClouds:
        """Return the clouds of these indices."""
        return LabelledClouds(self.points[shapes], self.parts[shapes])

    def divided(self, tested: int, points: int) -> tuple[LabelledClouds, LabelledClouds]:
        """Return the first `tested` clouds, with their first `points` points, and the others."""
        first = LabelledClouds(self.points[:tested, :points], self.parts[:tested, :points])
        return first, LabelledClouds(self.points[tested:], self.parts[tested:])


def scaled_to_diagonal(cloud: FloatArray) -> npt.NDArray[np.float32]:
    """Return a cloud (n, 3) centred and scaled to a bounding box of diagonal 1, float32 (n, 3)."""
    normalized = frame_of(cloud).normalized(cloud)
    diagonal = float(np.linalg.norm(np.ptp(normalized, axis=0))) or 1.0
    scaled: npt.NDArray[np.float32] = (normalized / diagonal).astype(np.float32)
    return scaled


def prepare(task: Task) -> Outcome:
    """Sample a cloud of at most `max_shapes` random shapes of train, and of val.

    Files of the shard: `.<split>.safetensors`, the fields of `LabelledClouds`, and `.json`, their counts. Shapes with
    points of one part alone are rejected. Raises Rejected where a split keeps no shape.
    """
    counts = {}
    for split in ("train", "val"):
        clouds = LabelledClouds.of(_clouds(task, split), LEARNT_POINTS, task.rng("points", split))
        if not len(clouds):
            raise Rejected(f"{task.shard.params['collection']} has no shape of two parts or more in split {split}")
        counts[split] = {"shapes": len(clouds)}
        write_arrays(task, f"{task.shard.name}.{split}.safetensors", clouds.arrays())
    write_description(task, {"counts": counts})
    return Outcome(samples=0, summary=counts)


def _clouds(task: Task, split: str) -> Iterator[tuple[FloatArray, npt.NDArray[np.integer]]]:
    """Yield the points of random shapes of a split, and the part of each point."""
    params, collection = task.shard.params, Collection(task)
    shards = {name: params["samples_of"][name] for name, of in params["splits"].items() if of == split}
    total = sum(shards.values())
    wanted = set(task.rng("shapes", split).permutation(total)[: params["max_shapes"]].tolist())
    number = 0
    for shard in shards:
        for sample in collection.samples(shard):
            if number in wanted:
                cloud = sample_shape(collection.shape(sample), LEARNT_POINTS, task.rng(sample.key))
                if len(np.unique(cloud.instances)) > 1:
                    yield cloud.points, cloud.instances
                else:
                    task.reject(sample.key, "has points of one part alone")
            number += 1
        task.progress(number, total)
