"""Pairs of parts as a member of a sample: contacts and joints."""

from __future__ import annotations

import numpy as np

from pipeline.shards import array_bytes, bytes_array
from stages.shape.arrays import IntArray

CONTACTS = "contacts.npy"
"""The pairs of parts that touch."""
JOINTS = "joints.npy"
"""The pairs of parts that count as connected where the shape is judged physically."""


def pair_bytes(pairs: IntArray) -> bytes:
    """`pairs`, int32 (m, 2), as the bytes of an array (2, m).

    Lying so, an array without pairs still has two rows with a type. Hugging Face `datasets` takes types from the first
    samples, and of (0, 2) it would see an empty list of nothing, into which no later pair fits.
    """
    return array_bytes(np.ascontiguousarray(pairs.T, dtype=np.int32))


def pairs_of(content: bytes) -> IntArray:
    """The pairs, int32 (m, 2), whose bytes `pair_bytes` made."""
    pairs: IntArray = np.ascontiguousarray(bytes_array(content).T)
    return pairs
