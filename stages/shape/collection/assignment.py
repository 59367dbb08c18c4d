"""Assign samples to splits, by structure rather than by row, and to the shards of each split.

A producer first decides which samples there are and writes one listing for each shard of the collection. The shards of
the collection then turn their listings into samples.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field

from pipeline.config import StrictModel
from pipeline.shards import ShardWriter, json_bytes
from pipeline.stage import Outcome, Plan, Shard, Task
from stages.shape.sample import Sample, write_sample

SPLITS = ("train", "val", "test")


class ShardConfig(StrictModel):
    """How the samples of a split are divided into shards."""

    shards: int = Field(8, ge=1, le=100_000, description="Minimum number of shards of a split.")
    samples_per_shard: int = Field(512, ge=1, description="Maximum number of samples in a shard.")

    def for_trial(self) -> Self:
        """Return one small shard for each split."""
        return self.model_copy(update={"shards": 1, "samples_per_shard": 8})


class SplitConfig(ShardConfig):
    """How the samples are divided into splits and shards."""

    val: float = Field(0.1, ge=0, lt=0.5, description="Share of the samples in the validation split.")
    test: float = Field(0.1, ge=0, lt=0.5, description="Share of the samples in the test split.")

    def sizes(self, samples: int) -> dict[str, int]:
        """Return the number of samples that each split should get."""
        val, test = round(self.val * samples), round(self.test * samples)
        return {"train": samples - val - test, "val": val, "test": test}

    def shard_sizes(self, samples: int) -> list[int]:
        """Return the number of samples in each shard if all splits get the sizes that they should."""
        counts = [np.bincount(_shard_of(size, self)) for size in self.sizes(samples).values()]
        return [int(count) for split_counts in counts for count in split_counts]


def assign_splits(
    groups: Sequence[Sequence[int]], config: SplitConfig, rng: np.random.Generator
) -> npt.NDArray[np.int64]:
    """Return the split of each row as an index into SPLITS, int64 (n,).

    Whole groups go to val and test until these have their shares. `groups` holds every row exactly once.
    """
    samples = sum(len(group) for group in groups)
    split_of = np.zeros(samples, dtype=np.int64)
    sizes = config.sizes(samples)
    missing = {1: sizes["val"], 2: sizes["test"]}
    for number in rng.permutation(len(groups)).tolist():
        split = max(missing, key=lambda index: (missing[index], -index))
        # A group much larger than what is missing would swamp a small split, so it stays in train.
        if missing[split] > 0 and len(groups[number]) <= max(2 * missing[split], 1):
            split_of[list(groups[number])] = split
            missing[split] -= len(groups[number])
    return split_of


def assign_shards(
    split_of: npt.NDArray[np.int64], config: ShardConfig, rng: np.random.Generator | None
) -> dict[str, list[npt.NDArray[np.int64]]]:
    """Return the rows of each shard of each split, each int64 (k,).

    split_of: index into SPLITS of each row, int64 (n,).
    rng: puts the rows in random order; None keeps their order.
    """
    order = np.arange(len(split_of)) if rng is None else rng.permutation(len(split_of))
    shards: dict[str, list[npt.NDArray[np.int64]]] = {}
    for split, name in enumerate(SPLITS):
        rows = order[split_of[order] == split]
        starts = np.flatnonzero(np.diff(_shard_of(len(rows), config))) + 1
        shards[name] = np.split(rows, starts) if len(rows) else []
    return shards


def _shard_of(samples: int, config: ShardConfig) -> npt.NDArray[np.int64]:
    """Return the shard of each sample of a split, int64 (samples,), ascending from 0."""
    shards = min(max(config.shards, -(-samples // config.samples_per_shard)), samples)
    return np.arange(samples) * shards // max(samples, 1)


def write_listings(
    task: Task,
    rows: Sequence[Mapping[str, Any]],
    split_of: npt.NDArray[np.int64],
    config: ShardConfig,
    shuffle: bool = True,
) -> dict[str, int]:
    """Write one file for each shard of the collection, `<shard>.<split>-<number>.jsonl`, with one sample a line.

    rows: `key`, `kit`, `graph`, `method`, `parents` and `text` of each sample.
    split_of: index into SPLITS of each row, int64 (n,).
    shuffle: whether the rows are put in random order.
    Returns the number of shards of each split.
    """
    shards = assign_shards(split_of, config, task.rng("order") if shuffle else None)
    for split, rows_of in shards.items():
        for number, members in enumerate(rows_of):
            with task.output(f"{task.shard.name}.{split}-{number:06d}.jsonl") as stream:
                stream.writelines(json_bytes(rows[row]) for row in members.tolist())
    return {split: len(rows_of) for split, rows_of in shards.items()}


def planned_collection(plan: Plan, counts: Mapping[str, int], inputs: tuple[str, ...]) -> list[Shard]:
    """Return the shards of the collection, `<dataset>-<split>-<index>`, with the params `job`, `split` and `number`.

    counts: the number of shards of each split.
    inputs: what every shard of the collection reads.
    """
    return [
        Shard(
            f"{plan.config.name}-{split}-{number:06d}", {"job": "collection", "split": split, "number": number}, inputs
        )
        for split in SPLITS
        for number in range(counts[split])
    ]


def write_listed_samples(task: Task, producer: str, assignment: str) -> Outcome:
    """Write the samples of one shard of the collection from its listing.

    producer: the stage that makes the samples.
    assignment: the shard that wrote the listings.
    """
    split, number = task.shard.params["split"], task.shard.params["number"]
    listing = task.input(producer, f"{assignment}.{split}-{number:06d}.jsonl").read_text(encoding="utf-8")
    with task.output(f"{task.shard.name}.tar") as stream, ShardWriter(stream) as writer:
        for line in listing.rstrip("\n").split("\n"):
            row = json.loads(line)
            lineage = {"method": row["method"], "parents": row["parents"]}
            sample = Sample(row["key"], split, producer, row["kit"], row["graph"], lineage, text=row["text"])
            write_sample(writer, sample)
    return Outcome(writer.samples, {"split": split, "samples": writer.samples})
