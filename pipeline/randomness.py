"""Counter-based randomness: each decision has its own stream, whatever the order of decisions."""

from __future__ import annotations

import hashlib

import numpy as np


def decision_rng(seed: int, *decision: str | int) -> np.random.Generator:
    """Return the random stream of one decision.

    The stream depends only on `seed` and on the words and numbers of `decision` (stage, shard, item, purpose). So a
    decision is the same with any number of workers, after a kill and on another machine.
    """
    spawn_key = tuple(
        int.from_bytes(hashlib.sha256(word.encode()).digest()[:4], "little") if isinstance(word, str) else int(word)
        for word in decision
    )
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=spawn_key)))
