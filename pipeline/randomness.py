"""Counted randomness: each decision has its own stream, named by what is decided, never by who decides first."""

from __future__ import annotations

import hashlib

import numpy as np


def decision_rng(seed: int, *decision: str | int) -> np.random.Generator:
    """The random stream of one decision.

    The stream depends on `seed` and on the words and numbers of `decision` (stage, shard, item, what is
    decided) and on nothing else, so the same decision falls alike with any number of workers, after a
    kill and on another machine.
    """
    spawn_key = tuple(
        int.from_bytes(hashlib.sha256(word.encode()).digest()[:4], "little") if isinstance(word, str) else int(word)
        for word in decision
    )
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=spawn_key)))
