"""Where Numba wastes time when it compiles kernels.

`quicken` replaces four functions of Numba, whose version is pinned. What kernels compute stays the same.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from numba.core import codegen, targetconfig
from numba.extending import overload
from numba.np import arrayobj


def quicken() -> None:
    """Replace the functions."""
    codegen.CPUCodeLibrary._optimize_functions = _leave_functions
    targetconfig.TargetConfig.__hash__ = _hash_of_flags
    targetconfig.TargetConfig.__eq__ = _are_equal_flags
    arrayobj.raise_with_shape_context = _shape_mismatch


def _leave_functions(library: codegen.CPUCodeLibrary, module: Any) -> None:
    """Do not optimise the functions of a module one by one: the passes over all its functions do that again."""
    module.data_layout = library._codegen._data_layout


# Flags of the compiler are keys of Numba's dictionaries of overloads: it looks there several hundred times for each
# kernel, and reads all options each time.


@cache
def _hash_of_options(kind: Any) -> int:
    return hash(tuple(sorted(kind.options)))


def _hash_of_flags(flags: targetconfig.TargetConfig) -> int:
    """Return Numba's own hash of flags, which is that of the names of the options."""
    kind: Any = type(flags)
    return _hash_of_options(kind)


_numba_equal_flags = targetconfig.TargetConfig.__eq__


def _are_equal_flags(flags: targetconfig.TargetConfig, others: Any) -> Any:
    """Compare the options that are set; all others have the same defaults."""
    if flags is others:
        return True
    if type(flags) is not type(others):
        return _numba_equal_flags(flags, others)
    return all(getattr(flags, name) == getattr(others, name) for name in {**flags._values, **others._values})


def _shape_mismatch(source_shape: Any, index_shape: Any) -> None:
    """Stand for the error of a slice that is assigned an array of another shape."""


@overload(_shape_mismatch)  # type: ignore[untyped-decorator]
def _raise_shape_mismatch(source_shape: Any, index_shape: Any) -> Callable[..., None]:
    """Return what raises it. Numba's own writes both shapes into the message, in each kernel that assigns slices."""

    def raise_shape_mismatch(source_shape: Any, index_shape: Any) -> None:
        raise ValueError("cannot assign slice from input of different size")

    return raise_shape_mismatch
