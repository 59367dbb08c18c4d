"""The record of the kernels that a run uses, from which `make kernels` makes the list.

With `SHAPEMILL_RECORD_KERNELS` in its environment, every worker appends a line to that file for each kernel that it
compiles or loads from the cache: `{"stage", "kernel", "calls", "seconds", "is_for_python"}`.
"""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

from numba.core import dispatcher, sigutils

from pipeline.compilation_note import stage_of_note
from pipeline.kernel_types import argument_words, name_of, named

_frames: list[list[str]] = []
"""Kernels called by each kernel that is being compiled, callers before callees."""

_nested_seconds = [0.0]
"""Seconds of the kernels called by each of these, after those of all kernels that nothing calls."""

_recorded: set[tuple[str, bool]] = set()
"""Kernels with whether Python called them."""


def record_kernels(file: Path) -> None:
    """Append what this process compiles and loads from now on to a file."""
    compile_now = dispatcher.Dispatcher.compile

    def compile_recorded(kernel: dispatcher.Dispatcher, signature: Any) -> Any:
        arguments, _ = sigutils.normalize_signature(signature)
        words = _words(kernel, arguments)
        if words is None:
            return compile_now(kernel, signature)
        key = json.dumps(words)
        is_for_python = not _frames
        if not is_for_python:
            _frames[-1].append(key)
        _frames.append([])
        _nested_seconds.append(0.0)
        start = time.process_time()
        try:
            compiled = compile_now(kernel, signature)
        finally:
            seconds = time.process_time() - start
            calls, nested = _frames.pop(), _nested_seconds.pop()
            _nested_seconds[-1] += seconds
        if (key, is_for_python) not in _recorded and stage_of_note():
            _recorded.add((key, is_for_python))
            line = {
                "stage": stage_of_note(),
                "kernel": words,
                "calls": calls,
                "seconds": seconds - nested,
                "is_for_python": is_for_python,
            }
            with open(file, "a", encoding="utf-8") as stream:
                stream.write(json.dumps(line) + "\n")
        return compiled

    dispatcher.Dispatcher.compile = compile_recorded


def _words(kernel: Any, arguments: tuple[Any, ...]) -> list[Any] | None:
    """Return name and types of a cached kernel of the project; None for any other.

    Raises TypeError where a type has no words: such a kernel would be compiled by workers, each for itself.
    """
    name = name_of(kernel.py_func)
    try:
        if not hasattr(kernel._cache, "cache_path") or named(name) is not kernel:
            return None
        return [name, [argument_words(argument) for argument in arguments]]
    except (AttributeError, ImportError):
        return None
