"""Batches of samples of similar length."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

BATCHES_PER_BUCKET = 16
"""Samples are sorted by length within a bucket of this many batches."""

Indices = npt.NDArray[np.int64]


def bucket_batches(lengths: Indices, size: int, rng: np.random.Generator | None) -> Iterator[Indices]:
    """Yield the samples of each batch, int64 (n,) with n at most `size`; every sample occurs once.

    lengths: int64 (samples,).
    rng: draws the order, and samples of similar length share a batch; without it samples keep their own order.
    """
    order = np.arange(len(lengths)) if rng is None else rng.permutation(len(lengths))
    batches: list[Indices] = []
    for start in range(0, len(order), size * BATCHES_PER_BUCKET):
        bucket = order[start : start + size * BATCHES_PER_BUCKET]
        if rng is not None:
            bucket = bucket[np.argsort(lengths[bucket], kind="stable")]
        batches += [bucket[begin : begin + size] for begin in range(0, len(bucket), size)]
    for number in range(len(batches)) if rng is None else rng.permutation(len(batches)):
        yield batches[int(number)]


def padded_rows(first: Indices, samples: Indices) -> tuple[npt.NDArray[np.bool_], Indices]:
    """Locate the rows of some samples, padded to the longest: which places are filled, bool (n, longest), and their
    rows, int64 (n, longest), 0 at padding.

    first: where the rows of each sample begin, int64 (samples + 1,).
    """
    lengths = np.diff(first)[samples]
    column = np.arange(lengths.max())
    filled = column < lengths[:, None]
    return filled, np.where(filled, first[samples][:, None] + column, 0)
