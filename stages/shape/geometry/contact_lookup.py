"""Hashes of poses, and tables indexed by them."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

from stages.variations.kernels.structs import MISSING


@numba.njit(cache=True)
def quantize_pose(first_rotation, first_translation, rotation, translation, reach, quantum, out):
    """Write the pose of the second part in coordinates of the first in whole quanta, int64 (12,): translation,
    rotation.
    """
    for i in range(3):
        x = 0.0
        for k in range(3):
            x += first_rotation[k, i] * (translation[k] - first_translation[k])
        out[i] = np.int64(np.floor(x / quantum + 0.5))
        for j in range(3):
            y = 0.0
            for k in range(3):
                y += first_rotation[k, i] * rotation[k, j]
            out[3 + 3 * i + j] = np.int64(np.floor(y * reach / quantum + 0.5))


@numba.njit(cache=True, inline="always")
def mix(x):
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))


@numba.njit(cache=True)
def contact_key(a, b, quanta):
    """Return a key of a type pair and a quantised pose, uint64, never 0."""
    x = mix(np.uint64(a) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(b) + np.uint64(1))
    for k in range(12):
        x = mix(x * np.uint64(0x9E3779B97F4A7C15) + np.uint64(quanta[k]))
    return x | np.uint64(1)


@numba.njit(cache=True)
def look_up(keys, values, key):
    mask = np.uint64(len(keys) - 1)
    slot = key & mask
    while keys[slot] != np.uint64(0):
        if keys[slot] == key:
            return values[slot]
        slot = (slot + np.uint64(1)) & mask
    return MISSING


@numba.njit(cache=True)
def look_up_around(keys, values, types, rotations, translations, b, rotation, translation, reach, quantum):
    """Return the known answers for a part of type b next to each of some others, int64 (n,)."""
    known = np.empty(len(types), dtype=np.int64)
    quanta = np.empty(12, dtype=np.int64)
    for i in range(len(types)):
        quantize_pose(rotations[i], translations[i], rotation, translation, reach, quantum, quanta)
        known[i] = look_up(keys, values, contact_key(types[i], b, quanta))
    return known


@intrinsic  # type: ignore[untyped-decorator]
def call_oracle(typing_context: Any, address: Any, a: Any, b: Any) -> tuple[Any, Any]:
    """Call the C function of two int64 at an address, which returns one: an answer from Python inside a kernel."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        word = ir.IntType(64)
        function = builder.inttoptr(arguments[0], ir.FunctionType(word, [word, word]).as_pointer())
        return builder.call(function, arguments[1:])

    return types.int64(types.int64, types.int64, types.int64), code


@numba.njit(cache=True)
def random_below(rng, n):
    return min(np.int64(rng.random() * n), n - 1)
