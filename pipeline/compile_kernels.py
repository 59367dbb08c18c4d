"""Compile the listed kernels: `python -m pipeline.compile_kernels`.

Set-up runs it while it downloads packages that no kernel needs, and ends it after that. A first run compiles the rest.
"""

from __future__ import annotations

import os
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from multiprocessing import get_context
from pathlib import Path

from pipeline.kernel_list import KERNEL_LIST, KernelList, Schedule, compile_kernel
from pipeline.termination import die_with_parent

FIRST_PRODUCER = "variations"
"""Producer of the default dataset, whose kernels come first."""

MAX_PROCESSES = 4
"""Each takes 200 MB."""


def main(file: Path = KERNEL_LIST) -> None:
    """Compile each kernel of a list that is not compiled yet, callees first, and print its name; on several cores."""
    listed = KernelList.read(file)
    first = set(listed.indices([FIRST_PRODUCER], listed.used.get(FIRST_PRODUCER, ())))
    processes = min(len(os.sched_getaffinity(0)), MAX_PROCESSES)
    with ProcessPoolExecutor(processes, get_context("fork"), initializer=die_with_parent) as pool:
        for kernels in (first, set(range(len(listed.kernels))) - first):
            schedule, running = Schedule(listed, kernels), dict[Future[None], int]()
            while schedule.ready or running:
                while schedule.ready and len(running) < processes:
                    index = schedule.next()
                    running[pool.submit(compile_kernel, listed.kernels[index])] = index
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    future.result()
                    index = running.pop(future)
                    schedule.end(index)
                    print(listed.kernels[index].name, flush=True)


if __name__ == "__main__":
    main()
