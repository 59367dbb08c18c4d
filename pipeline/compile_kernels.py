"""Compile the listed kernels in one process: `python -m pipeline.compile_kernels`.

Set-up runs it while it downloads packages that no kernel needs, and ends it after that. A first run compiles the rest.
"""

from __future__ import annotations

from pathlib import Path

from pipeline.kernel_list import KERNEL_LIST, KernelList, Schedule, compile_kernel

FIRST_PRODUCER = "variations"
"""Producer of the default dataset, whose kernels come first."""


def main(file: Path = KERNEL_LIST) -> None:
    """Compile each kernel of a list that is not compiled yet, callees first, and print its name."""
    listed = KernelList.read(file)
    first = set(listed.indices([FIRST_PRODUCER], listed.used.get(FIRST_PRODUCER, ())))
    for kernels in (first, set(range(len(listed.kernels))) - first):
        schedule = Schedule(listed, kernels)
        while schedule.ready:
            index = schedule.next()
            compile_kernel(listed.kernels[index])
            schedule.end(index)
            print(listed.kernels[index].name, flush=True)


if __name__ == "__main__":
    main()
