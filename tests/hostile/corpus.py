"""Reading of hostile files: the result and the cost of each."""

from __future__ import annotations

import resource
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.errors import ConfigError
from stages.exemplars.read import read_parts
from stages.model_files.limits import ReadLimits
from tests.hostile.good import write_good
from tests.hostile.mutate import mutate

LIMITS = ReadLimits(cpu_seconds=20, memory_mb=1000)

PYTHON_WORDS = (
    "Traceback", "Error:", "object at 0x", "not supported between", "unsupported operand", "has no attribute",
    "invalid literal", "could not convert", "NoneType", "dtype(", "Exception",
)  # fmt: skip
"""Words of Python's own messages, which an error for users does not hold."""


@dataclass(frozen=True)
class Outcome:
    """Result of reading a hostile file.

    end: `read`, `refused` (with the reader's message), `stopped` (by a limit or an unexpected error), or `escaped`
    message: message of the error
    cpu: CPU seconds
    """

    number: int
    suffix: str
    mutation: str
    end: str
    message: str
    cpu: float
    path: Path


def outcomes(folder: Path, count: int, seed: int) -> Iterator[Outcome]:
    """Make hostile files in `folder`, one at a time, and read each."""
    good = write_good(folder)
    contents = {file: file.read_bytes() for file in good}
    for file in good:
        read_parts(file)  # compile kernels before times are measured
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        origin = good[number % len(good)]
        mutation, content = mutate(contents[origin], rng)
        path = folder / f"hostile-{number}{origin.suffix}"
        path.write_bytes(content)
        before = _cpu()
        end, message = _read(path)
        yield Outcome(number, origin.suffix, mutation, end, message, _cpu() - before, path)
        path.unlink(missing_ok=True)


def _read(path: Path) -> tuple[str, str]:
    started = time.monotonic()
    try:
        model = read_parts(path, "auto" if path.suffix != ".glb" else "nodes", LIMITS)
        "".join([*(part.name for part in model.parts), *model.warnings]).encode()
        assert all(np.isfinite(part.vertices).all() for part in model.parts)
    except ConfigError as error:
        message = str(error)
        message.encode()
        if not message.startswith(f"{path}") or "\n" in message or any(word in message for word in PYTHON_WORDS):
            return "escaped", message
        if time.monotonic() - started > 10 * LIMITS.cpu_seconds:
            return "escaped", "it ran on"
        return "stopped" if "exemplars.limits" in message else "refused", message
    except BaseException as error:
        return "escaped", f"{type(error).__name__}: {error}"
    return "read", ""


def _cpu() -> float:
    both = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(usage.ru_utime + usage.ru_stime for usage in both)
