"""The assignment of samples to splits and shards."""

from __future__ import annotations

import numpy as np

from stages.shape.collection.assignment import SplitConfig, assign_shards, assign_splits


def test_groups_stay_whole_and_splits_get_their_shares() -> None:
    groups = [[3 * group, 3 * group + 1, 3 * group + 2] for group in range(100)]
    split_of = assign_splits(groups, SplitConfig(val=0.1, test=0.2), np.random.default_rng(1))
    assert all(len(set(split_of[group])) == 1 for group in groups)
    assert np.bincount(split_of).tolist() == [210, 30, 60]


def test_group_larger_than_a_small_split_stays_in_train() -> None:
    split_of = assign_splits(
        [list(range(90)), *([row] for row in range(90, 100))], SplitConfig(), np.random.default_rng(1)
    )
    assert not split_of[:90].any()


def test_every_row_is_in_one_shard_of_its_split() -> None:
    config = SplitConfig(shards=3, samples_per_shard=20)
    split_of = np.array([0] * 100 + [1] * 2 + [2] * 0)
    shards = assign_shards(split_of, config, np.random.default_rng(1))
    assert [len(rows) for rows in shards["train"]] == [20] * 5
    assert [len(rows) for rows in shards["val"]] == [1, 1]
    assert shards["test"] == []
    assert sorted(np.concatenate(shards["train"]).tolist()) == list(range(100))
    assert sorted(np.concatenate(shards["val"]).tolist()) == [100, 101]


def test_without_a_random_order_rows_keep_their_own() -> None:
    shards = assign_shards(np.array([0, 1, 0, 0, 1]), SplitConfig(shards=2), None)
    assert {split: [rows.tolist() for rows in of_split] for split, of_split in shards.items()} == {
        "train": [[0, 2], [3]],
        "val": [[1], [4]],
        "test": [],
    }


def test_expected_shard_sizes_are_those_of_the_assignment() -> None:
    config = SplitConfig(val=0.1, test=0.0, shards=3, samples_per_shard=20)
    assert config.shard_sizes(100) == [18, 18, 18, 18, 18, 4, 3, 3]
