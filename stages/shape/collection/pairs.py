"""Pairs of parts as a member of a sample: contacts and joints."""

from __future__ import annotations

import numpy as np

from pipeline.shards import array_bytes, bytes_array
from stages.shape.arrays import IntArray

CONTACTS = "contacts.npy"
"""The pairs of parts that touch."""
JOINTS = "joints.npy"
"""The pairs of parts that count as connected in the physical checks."""


def pair_bytes(pairs: IntArray) -> bytes:
    """Return `pairs`, int32 (m, 2), as the bytes of an array (2, m).

    In this layout an array without pairs still has two rows with a type. Hugging Face `datasets` infers types from the
    first samples, and would infer an empty list from (0, 2).
    """
    return array_bytes(np.ascontiguousarray(pairs.T, dtype=np.int32))


def pairs_of(content: bytes) -> IntArray:
    """Return the pairs, int32 (m, 2), from the bytes of `pair_bytes`."""
    pairs: IntArray = np.ascontiguousarray(bytes_array(content).T)
    return pairs
