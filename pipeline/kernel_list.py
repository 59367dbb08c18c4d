"""The kernels that stages use: listed in `kernels.json`, and compiled ahead by the workers of a run.

Numba knows the types of a kernel's arguments when it is first called. The list holds them from a recorded run
(`make kernels`), with the kernels that each kernel calls. So the workers of a run can compile all kernels at its start,
each once, callees first. A list that is out of date costs time alone: a kernel that it lacks is compiled on first use,
and one that no longer exists is skipped.
"""

from __future__ import annotations

import heapq
import json
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pipeline.workers import Workers

KERNEL_LIST = Path(__file__).with_name("kernels.json")

_POLL_SECONDS = 0.25
_LOADING_SECONDS = 0.5
"""What a kernel takes besides its own compilation: another process may have compiled what it calls."""


@dataclass(frozen=True)
class ListedKernel:
    """A kernel for some types of arguments.

    name: module and qualified name, as `module:name`
    arguments: types, as `argument_words` writes them
    calls: indices of the kernels that it calls, in the list
    seconds: CPU time of its own compilation when it was recorded
    is_for_python: whether Python calls it, not other kernels alone
    """

    name: str
    arguments: list[Any]
    calls: list[int]
    seconds: float
    is_for_python: bool


@dataclass(frozen=True)
class KernelList:
    """All listed kernels, and those that each stage uses in datasets of each producer, by index."""

    kernels: list[ListedKernel]
    used: Mapping[str, Mapping[str, list[int]]]

    @classmethod
    def read(cls, file: Path = KERNEL_LIST) -> KernelList:
        """Read the list; an empty one where the file is missing or corrupted."""
        try:
            content = json.loads(file.read_bytes())
            return cls([ListedKernel(*kernel) for kernel in content["kernels"]], content["used"])
        except (OSError, ValueError, KeyError, TypeError):
            return cls([], {})

    def indices(self, producers: Iterable[str], stages: Iterable[str]) -> list[int]:
        """Return the kernels that some stages use in datasets of some producers, with all that these call."""
        stages = list(stages)
        waiting = [index for name in producers for stage in stages for index in self.used.get(name, {}).get(stage, ())]
        reached: set[int] = set()
        while waiting:
            index = waiting.pop()
            if index not in reached:
                reached.add(index)
                waiting += self.kernels[index].calls
        return sorted(reached)

    def names(self, indices: list[int]) -> dict[str, str]:
        """Return names of kernels with the types of their arguments and their callers, for a digest."""
        kernels = [self.kernels[index] for index in indices]
        return {json.dumps([kernel.name, kernel.arguments, kernel.is_for_python]): "" for kernel in kernels}

    @cached_property
    def seconds(self) -> list[float]:
        """Seconds that each kernel is expected to take."""
        return [kernel.seconds + _LOADING_SECONDS for kernel in self.kernels]

    @cached_property
    def urgency(self) -> list[float]:
        """Seconds from the start of each kernel's compilation to the end of the last caller that waits for it."""
        urgency = list(self.seconds)
        for index in reversed(range(len(urgency))):  # callees come before their callers
            for callee in self.kernels[index].calls:
                urgency[callee] = max(urgency[callee], self.seconds[callee] + urgency[index])
        return urgency


def compile_ahead(
    listed: KernelList, indices: list[int], workers: Workers, show: Callable[[CompilationProgress], None]
) -> int:
    """Compile those of some listed kernels that are not compiled yet, on all workers; return their number.

    show: called about every quarter of a second

    Kernels that cannot be compiled are left to their first use.
    """
    schedule = Schedule(
        listed, _missing_of(listed, indices, workers, lambda: show(CompilationProgress(0, 0, 0.0, 0.0)))
    )
    running: dict[Future[Any], int] = {}
    while schedule.ready or running:
        while schedule.ready and workers.idle:
            index = schedule.next()
            running[workers.call(compile_kernel, listed.kernels[index])] = index
        for future in workers.ended_calls(_POLL_SECONDS):
            schedule.end(running.pop(future))
        show(schedule.progress)
    return schedule.progress.total


def _missing_of(listed: KernelList, indices: list[int], workers: Workers, show: Callable[[], None]) -> set[int]:
    """Return those of some kernels that are not compiled; all, where the worker that looks dies."""
    if not indices:
        return set()
    future = workers.call(are_compiled, [listed.kernels[index] for index in indices])
    while not list(workers.ended_calls(_POLL_SECONDS)):
        show()
    compiled = future.result() if future.exception() is None else [False] * len(indices)
    return {index for index, is_compiled in zip(indices, compiled, strict=True) if not is_compiled}


@dataclass(frozen=True)
class CompilationProgress:
    """Numbers of compiled kernels and of all that are to be compiled, and the same in expected seconds.

    `total` is 0 while a worker looks for those that are not compiled.
    """

    done: int
    total: int
    worked: float
    work: float


class Schedule:
    """The order in which kernels are compiled: callees first, and of those that can be, the most urgent one."""

    def __init__(self, listed: KernelList, kernels: set[int]) -> None:
        self._listed = listed
        self._uncompiled = {index: kernels.intersection(listed.kernels[index].calls) for index in kernels}
        self.ready = [(-listed.urgency[index], index) for index in kernels if not self._uncompiled[index]]
        heapq.heapify(self.ready)
        self.progress = CompilationProgress(0, len(kernels), 0.0, sum(listed.seconds[index] for index in kernels))

    def next(self) -> int:
        """Return the kernel to compile now, and take it out."""
        return heapq.heappop(self.ready)[1]

    def end(self, index: int) -> None:
        """Note that a kernel is compiled, or cannot be."""
        now = self.progress
        worked = now.worked + self._listed.seconds[index]
        self.progress = CompilationProgress(now.done + 1, now.total, worked, now.work)
        for caller, callees in self._uncompiled.items():
            if index in callees:
                callees.remove(index)
                if not callees:
                    heapq.heappush(self.ready, (-self._listed.urgency[caller], caller))


# In workers ---------------------------------------------------------------------------------------------------------


def are_compiled(kernels: list[ListedKernel]) -> list[bool]:
    """Return whether each kernel is in the cache; one that no longer exists needs no compilation."""
    from pipeline.kernel_cache import is_cached

    found = zip(map(_found, kernels), kernels, strict=True)
    return [item is None or is_cached(*item, kernel.is_for_python) for item, kernel in found]


def compile_kernel(kernel: ListedKernel) -> None:
    """Compile a kernel into the cache; what cannot be compiled is left to its first use."""
    from pipeline.kernel_cache import compile_for_kernels

    found = _found(kernel)
    if found is not None:
        dispatcher, arguments = found
        with suppress(Exception):
            if kernel.is_for_python:
                dispatcher.compile(arguments)
            else:
                compile_for_kernels(dispatcher, arguments)


def _found(kernel: ListedKernel) -> tuple[Any, tuple[Any, ...]] | None:
    """Return the kernel and the types of its arguments; None where a name in them no longer exists."""
    from pipeline.kernel_types import argument_type, named

    try:
        dispatcher = named(kernel.name)
        arguments = tuple(argument_type(words) for words in kernel.arguments)
    except Exception:  # the code has changed since
        return None
    return (dispatcher, arguments) if hasattr(dispatcher, "py_func") else None
