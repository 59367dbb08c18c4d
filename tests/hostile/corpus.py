"""Each hostile file is read; what became of it, and what it cost."""

from __future__ import annotations

import resource
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.errors import ConfigError
from stages.exemplars.read import read_model
from stages.exemplars.settings import ReadLimits
from tests.hostile.good import write_good
from tests.hostile.mutate import mutate

LIMITS = ReadLimits(cpu_seconds=20, memory_mb=1000)

PYTHONS_OWN = (
    "Traceback", "Error:", "object at 0x", "not supported between", "unsupported operand", "has no attribute",
    "invalid literal", "could not convert", "NoneType", "dtype(", "Exception",
)  # fmt: skip
"""What a message in our own words does not hold."""


@dataclass(frozen=True)
class Outcome:
    """What became of a hostile file.

    end: `read`, `refused` (in the reader's own words), `stopped` (by a limit, or by what no reader foresaw), or
    `escaped`; cpu: seconds; message: of the error.
    """

    number: int
    suffix: str
    mutation: str
    end: str
    message: str
    cpu: float
    path: Path


def outcomes(folder: Path, count: int, seed: int) -> Iterator[Outcome]:
    """Make `count` hostile files in `folder`, one after another, and read each."""
    good = write_good(folder)
    contents = {item: item.read_bytes() for item in good}
    for item in good:
        read_model(item)  # what is compiled on a fresh clone is no work on a hostile file
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
        model = read_model(path, "auto" if path.suffix != ".glb" else "nodes", LIMITS)
        "".join([*(part.name for part in model.parts), *model.warnings]).encode()
        assert all(np.isfinite(part.vertices).all() for part in model.parts)
    except ConfigError as error:
        message = str(error)
        message.encode()
        if not message.startswith(f"{path}") or "\n" in message or any(item in message for item in PYTHONS_OWN):
            return "escaped", message
        if time.monotonic() - started > 10 * LIMITS.cpu_seconds:
            return "escaped", "it ran on"
        return "stopped" if "exemplars.limits" in message else "refused", message
    except BaseException as error:
        return "escaped", f"{type(error).__name__}: {error}"
    return "read", ""


def _cpu() -> float:
    both = [resource.getrusage(item) for item in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(item.ru_utime + item.ru_stime for item in both)
