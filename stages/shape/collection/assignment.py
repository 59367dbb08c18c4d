"""Splits by structure, not by row, and splits to shards."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import numpy.typing as npt

SPLITS = ("train", "val", "test")


def assign_splits(
    groups: Sequence[Sequence[int]], val: float, test: float, rng: np.random.Generator
) -> npt.NDArray[np.int64]:
    """The split of each row, int64 (n,), counted as in SPLITS. `groups` has every row once: whole groups go to val and
    test until these have their shares."""
    total = sum(len(group) for group in groups)
    split_of = np.zeros(total, dtype=np.int64)
    left = {1: round(val * total), 2: round(test * total)}
    for number in rng.permutation(len(groups)).tolist():
        split = max(left, key=lambda each: (left[each], -each))
        # A group much larger than what is left would swamp a small split; it stays in train.
        if left[split] > 0 and len(groups[number]) <= max(2 * left[split], 1):
            split_of[list(groups[number])] = split
            left[split] -= len(groups[number])
    return split_of


def shards_of_split(samples: int, fewest: int, most_samples: int) -> npt.NDArray[np.int64]:
    """The shard of each sample of a split, int64 (samples,), ascending from 0: at least `fewest` shards if there are as
    many samples, of at most `most_samples` each."""
    shards = min(max(fewest, -(-samples // most_samples)), samples)
    return np.arange(samples) * shards // max(samples, 1)


def shard_sizes(splits: Iterable[int], fewest: int, most_samples: int) -> list[int]:
    """The samples of each shard of `shards_of_split`, for splits of so many samples each."""
    counts = [np.bincount(shards_of_split(samples, fewest, most_samples)) for samples in splits]
    return [int(count) for each in counts for count in each]
