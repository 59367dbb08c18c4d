"""Which samples stand together in a batch, where they are of different lengths."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

BATCHES_PER_BUCKET = 16
"""Samples of like length stand together in a batch, chosen from so many batches at once."""

Indices = npt.NDArray[np.int64]


def bucket_batches(lengths: Indices, size: int, rng: np.random.Generator | None) -> Iterator[Indices]:
    """The samples of each batch of at most `size`, int64 (n,), by their lengths int64 (samples,): all once, in random
    order, those of like length together; with no `rng`, in their order."""
    order = np.arange(len(lengths)) if rng is None else rng.permutation(len(lengths))
    chosen: list[Indices] = []
    for start in range(0, len(order), size * BATCHES_PER_BUCKET):
        pool = order[start : start + size * BATCHES_PER_BUCKET]
        if rng is not None:
            pool = pool[np.argsort(lengths[pool], kind="stable")]
        chosen += [pool[begin : begin + size] for begin in range(0, len(pool), size)]
    for number in range(len(chosen)) if rng is None else rng.permutation(len(chosen)):
        yield chosen[int(number)]
