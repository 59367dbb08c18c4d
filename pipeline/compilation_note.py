"""Note of a shard whose worker compiles kernels, for the progress of the run; and lines of a command that compiles.

It imports no Numba, which would take the driver of a run half a second.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from pipeline.display import Display

RECORD_VARIABLE = "SHAPEMILL_RECORD_KERNELS"
"""Environment variable: the file in which workers record the kernels that they use (`pipeline/kernel_record.py`)."""

_files: list[Path] = []
"""Note of the shard that this process makes, if any."""

_displays: list[Display] = []
"""Where this process shows that it compiles, if it is that of a command."""


@contextmanager
def compilation_noted_in(file: Path) -> Iterator[None]:
    """Within the context, note in this file that kernels are compiled."""
    delete_note(file)
    _files.append(file)
    try:
        yield
    finally:
        delete_note(_files.pop())


def show_compilation(command: str) -> None:
    """Show from now on, under the name of a command, that this process compiles kernels."""
    _displays.append(Display(command))


def note_compilation(compiled: int) -> None:
    """Note that a kernel is compiled now, and how many this process has compiled before."""
    for display in _displays:
        display.show(f"compiling kernels, once on this machine: {compiled} done")
    for file in _files:
        with suppress(OSError):
            file.write_text(f"{compiled} 1", encoding="utf-8")


def note_end_of_compilation(compiled: int) -> None:
    """Note that nothing is compiled now, where a note says otherwise."""
    for display in _displays:
        display.close()
    for file in _files:
        with suppress(OSError):
            if file.exists():
                file.write_text(f"{compiled} 0", encoding="utf-8")


def stage_of_note() -> str:
    """Return the stage whose shard this process makes; empty without one."""
    return _files[-1].parents[1].name if _files else ""


def read_compilation_note(file: Path) -> tuple[int, bool]:
    """Return how many kernels the process of a note has compiled, and whether it compiles now."""
    with suppress(OSError, ValueError):
        compiled, compiles = file.read_text(encoding="utf-8").split()
        return int(compiled), compiles == "1"
    return 0, False


def delete_note(file: Path) -> None:
    with suppress(OSError):
        file.unlink()
