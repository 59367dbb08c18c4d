"""Compile the listed kernels in one process: `python -m pipeline.compile_kernels`.

Set-up runs it while it downloads packages that no kernel needs, and ends it after that. A first run compiles the rest.
"""

from __future__ import annotations

from pathlib import Path

from pipeline.kernel_list import KERNEL_LIST, KernelList, Schedule, compile_kernel


def main(file: Path = KERNEL_LIST) -> None:
    """Compile each kernel of a list that is not compiled yet, callees first, and print its name."""
    listed = KernelList.read(file)
    schedule = Schedule(listed, set(range(len(listed.kernels))))
    while schedule.ready:
        index = schedule.next()
        compile_kernel(listed.kernels[index])
        schedule.end(index)
        print(listed.kernels[index].name, flush=True)


if __name__ == "__main__":
    main()
