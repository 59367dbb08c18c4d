"""Which samples stand together in a batch."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from stages.training.bucketing import BATCHES_PER_BUCKET, bucket_batches


@given(st.lists(st.integers(1, 99), max_size=200), st.integers(1, 9), st.integers(0, 9))
def test_every_sample_is_in_one_batch(lengths: list[int], size: int, seed: int) -> None:
    for rng in (None, np.random.default_rng(seed)):
        batches = [batch.tolist() for batch in bucket_batches(np.array(lengths, np.int64), size, rng)]
        assert sorted(sample for batch in batches for sample in batch) == list(range(len(lengths)))
        assert all(0 < len(batch) <= size for batch in batches)
        if rng is None:
            assert [sample for batch in batches for sample in batch] == list(range(len(lengths)))


def test_samples_of_similar_length_share_batches_in_random_order() -> None:
    lengths = np.random.default_rng(0).permutation(8 * BATCHES_PER_BUCKET)
    batches = [sorted(lengths[batch].tolist()) for batch in bucket_batches(lengths, 8, np.random.default_rng(1))]
    assert sorted(batches) == [list(range(start, start + 8)) for start in range(0, 8 * BATCHES_PER_BUCKET, 8)]
    assert batches != sorted(batches)
    assert batches == [
        sorted(lengths[batch].tolist()) for batch in bucket_batches(lengths, 8, np.random.default_rng(1))
    ]
