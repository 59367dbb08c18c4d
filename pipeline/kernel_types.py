"""Names of kernels, and types of their arguments as JSON."""

from __future__ import annotations

import importlib
from functools import reduce
from typing import Any

from numba.core import types


def name_of(item: Any) -> str:
    """Return the name of a kernel's function or of a class as `module:qualified name`."""
    return f"{item.__module__}:{item.__qualname__}"


def named(name: str) -> Any:
    """Return what has a name of `name_of`. Raises ImportError or AttributeError."""
    module, _, path = name.partition(":")
    return reduce(getattr, path.split("."), importlib.import_module(module))


def argument_words(argument: Any) -> Any:
    """Write a type of an argument as JSON. Raises TypeError for one that has no words."""
    if isinstance(argument, types.Array):
        flags = "".join(flag for flag, on in (("r", not argument.mutable), ("u", not argument.aligned)) if on)
        return ["array", argument_words(argument.dtype), argument.ndim, argument.layout, flags]
    if isinstance(argument, types.BaseTuple):
        kind = getattr(argument, "instance_class", None)
        return ["tuple", kind and name_of(kind), *map(argument_words, argument.types)]
    if isinstance(argument, types.Dispatcher):
        return ["kernel", name_of(argument.dispatcher.py_func)]
    if isinstance(argument, types.Omitted):
        return ["omitted", argument.value]
    if isinstance(argument, types.Literal):
        return ["literal", argument.literal_value]
    if isinstance(argument, types.Optional):
        return ["optional", argument_words(argument.type)]
    if argument == types.npy_rng:
        return "npy_rng"
    if getattr(types, str(argument), None) == argument:
        return str(argument)
    raise TypeError(f"a kernel argument of type {argument} has no words")


def argument_type(words: Any) -> Any:
    """Return the type that `argument_words` wrote. Raises for names that no longer exist."""
    if isinstance(words, str):
        return getattr(types, words)
    kind, *rest = words
    if kind == "array":
        dtype, ndim, layout, flags = rest
        return types.Array(argument_type(dtype), ndim, layout, readonly="r" in flags, aligned="u" not in flags)
    if kind == "tuple":
        return types.BaseTuple.from_types([argument_type(item) for item in rest[1:]], rest[0] and named(rest[0]))
    if kind == "kernel":
        return types.Dispatcher(named(rest[0]))
    if kind == "literal":
        return types.literal(rest[0])
    return types.Omitted(rest[0]) if kind == "omitted" else types.Optional(argument_type(rest[0]))
