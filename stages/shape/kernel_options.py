"""Options of kernels, for `numba.njit`."""

from __future__ import annotations

CALLED_BY_KERNELS = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
"""Of a kernel that only kernels call: code that unpacks Python's arguments would take a third of its compilation.

A call from Python would end the process. `tests/test_architecture.py` checks that no Python code names such a kernel.
"""
