"""The table of known contacts, looked up by two part types and their quantized relative pose."""

from __future__ import annotations

import ctypes
from typing import Any, NamedTuple

import numba
import numpy as np
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

from stages.shape.geometry.hash_tables import MISSING_KEY, look_up, mix

NO_CONTACT, FORBIDDEN_CONTACT, UNKNOWN_CONTACT = -1, -2, MISSING_KEY
"""Answers that are no pair of docking labels: no contact, a forbidden contact, not known yet."""
LABEL_BASE = 1 << 20
"""An answer that is a contact is `first label * LABEL_BASE + second label`."""
POSE_QUANTUM = 1 / 64
"""Step of the quantized poses, as a share of the contact tolerance."""


class ContactTable(NamedTuple):
    """Known answers, an open-addressing table."""

    keys: np.ndarray  # uint64 (2^k,): `contact_key`, 0 where free
    values: np.ndarray  # int64 (2^k,): NO_CONTACT, FORBIDDEN_CONTACT or a packed pair of docking labels


@numba.njit(cache=True)
def quantize_pose(first_rotation, first_translation, rotation, translation, reach, quantum, out):
    """Write the second part's pose relative to the first, in whole quanta, into `out`.

    out: int64 (12,), translation then rotation
    reach: half the diagonal of the second part, which scales rotations to lengths
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


@numba.njit(cache=True)
def contact_key(a, b, quanta):
    """Return the key of two part types and a quantized pose int64 (12,), uint64, never 0."""
    x = mix(np.uint64(a) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(b) + np.uint64(1))
    for k in range(12):
        x = mix(x * np.uint64(0x9E3779B97F4A7C15) + np.uint64(quanta[k]))
    return x | np.uint64(1)


@numba.njit(cache=True)
def look_up_around(keys, values, types, rotations, translations, b, rotation, translation, reach, quantum):
    """Return the known answers for a part of type `b` at a pose and each of n other parts, int64 (n,)."""
    answers = np.empty(len(types), dtype=np.int64)
    quanta = np.empty(12, dtype=np.int64)
    for i in range(len(types)):
        quantize_pose(rotations[i], translations[i], rotation, translation, reach, quantum, quanta)
        answers[i] = look_up(keys, values, contact_key(types[i], b, quanta))
    return answers


@intrinsic  # type: ignore[untyped-decorator]
def _call_compiled(typing_context: Any, address: Any, a: Any, b: Any) -> tuple[Any, Any]:
    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        word = ir.IntType(64)
        function = builder.inttoptr(arguments[0], ir.FunctionType(word, [word, word]).as_pointer())
        return builder.call(function, arguments[1:])

    return types.int64(types.int64, types.int64, types.int64), code


def _call_interpreted(address: int, a: int, b: int) -> int:
    return int(ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64, ctypes.c_int64)(address)(a, b))


call_oracle: Any = _call_interpreted if numba.config.DISABLE_JIT else _call_compiled
"""Calls the C function (int64, int64) -> int64 at an address: `ContactOracle.c_callback`."""
