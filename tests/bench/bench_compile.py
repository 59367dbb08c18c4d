"""CPU seconds in which Numba compiles the listed kernels, by folder of their source.

One process with an empty cache compiles them, callees first. A function's seconds are without those of the functions
that it calls. Functions of Numba itself, such as `argsort`, are compiled again for each process that calls them.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path

from pipeline.kernel_list import KernelList, compile_kernel
from tests.bench.measure import Measure

ROOT = Path(__file__).resolve().parents[2]


def bench() -> Iterator[Measure]:
    """Measure all rooms, then each."""
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [sys.executable, "-m", "tests.bench.bench_compile"],
            cwd=ROOT,
            env=os.environ | {"NUMBA_CACHE_DIR": folder},
            stdout=subprocess.PIPE,
            text=True,
            check=True,
        )
    seconds: Counter[str] = Counter()
    functions: defaultdict[str, set[str]] = defaultdict(set)
    for name, own_seconds in json.loads(done.stdout):
        room = "/".join(name.split(".")[:3]) if name.startswith(("stages.", "eval.")) else "numba"
        for group in ("all listed kernels", room):
            seconds[group] += own_seconds
            functions[group].add(name)
    for group, spent in seconds.most_common():
        note = f"{spent:.1f} CPU s for {len(functions[group])} functions"
        yield Measure(f"compilation, {group}", "times", 1 / spent, note=note)


def own_seconds() -> list[tuple[str, float]]:
    """Compile all listed kernels; return module and name of each compiled function with its own CPU seconds."""
    from numba.core import event

    nested, found = [0.0], []

    class Stopwatch(event.Listener):  # type: ignore[misc]
        def on_start(self, event: event.Event) -> None:
            starts.append(time.process_time())
            nested.append(0.0)

        def on_end(self, event: event.Event) -> None:
            spent, inside = time.process_time() - starts.pop(), nested.pop()
            nested[-1] += spent
            function = event.data["dispatcher"].py_func
            found.append((f"{function.__module__}.{function.__qualname__}", spent - inside))

    starts: list[float] = []
    event.register("numba:compile", Stopwatch())
    for kernel in KernelList.read().kernels:
        compile_kernel(kernel)
    return found


if __name__ == "__main__":
    print(json.dumps(own_seconds()))
