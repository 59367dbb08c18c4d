"""The folder of compiled kernels. It imports no Numba, which would take the driver of a run half a second."""

from __future__ import annotations

import atexit
import hashlib
import os
import platform
import shutil
import sys
import tempfile
import time
from contextlib import suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path

UNUSED_DAYS = 30
"""Entries that no process loads for this long are deleted."""

DAY_SECONDS = 86_400.0


def kernel_folder() -> Path:
    """Return the folder of compiled kernels: NUMBA_CACHE_DIR, or `shapemill/kernels` in the user's cache.

    Where that cannot be written, it is in the source tree, else a temporary folder that is deleted at exit.
    """
    if folder := os.environ.get("NUMBA_CACHE_DIR"):
        return Path(folder)
    return _default_folder()


@cache
def _default_folder() -> Path:
    user_cache = Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache")
    for path in (user_cache / "shapemill/kernels", Path(__file__).parent / "__pycache__/kernels"):
        with suppress(OSError, RuntimeError):  # RuntimeError: nobody knows the home folder
            folder = path.expanduser()
            folder.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
            prune_kernels(folder, time.time())
            return folder
    folder = Path(tempfile.mkdtemp(prefix="shapemill-kernels-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def prune_kernels(folder: Path, now: float) -> None:
    """Delete entries unused for UNUSED_DAYS, at most once a day."""
    stamp = folder / ".pruned"
    with suppress(OSError):
        if now - stamp.stat().st_mtime < DAY_SECONDS:
            return
    stamp.touch()
    for entry in (*folder.glob("*/*.nb[ci]*"), *folder.glob("complete/*")):
        with suppress(OSError):
            if now - entry.stat().st_mtime > UNUSED_DAYS * DAY_SECONDS:
                entry.unlink()


def all_compiled(code: str) -> bool:
    """Whether `note_all_compiled` was called on such a machine, for kernels of code with this digest."""
    return _note(code).is_file()


def note_all_compiled(code: str) -> None:
    """Note that all kernels that a run needs are compiled; the note lasts as long as they do without use."""
    with suppress(OSError):
        note = _note(code)
        note.parent.mkdir(parents=True, exist_ok=True)
        note.touch()


def _note(code: str) -> Path:
    """Return the note's path, which holds all that Numba's compiled code depends on, with the processor."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text(encoding="utf-8").splitlines() if info.is_file() else [platform.processor()]
    processor = sorted({line for line in lines if line.startswith(("model name", "flags", "Features"))})
    words = repr((code, sys.version, version("numba"), processor, os.environ.get("NUMBA_CPU_NAME")))
    return kernel_folder() / "complete" / hashlib.sha256(words.encode()).hexdigest()[:32]
