"""`shapemill doctor`: try everything that Shapemill needs on this machine, with the mend for what fails.

Each library is imported, and each renderer draws a triangle, in a process of its own: a crash is a row of the table.
"""

from __future__ import annotations

import os
import platform
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Literal

from pipeline.disk_space import byte_size

_HERE = Path(__file__).parent
_LOCK = _HERE.parent / "requirements.lock"
_LIBRARIES = _HERE / "libraries.txt"
_TRY_SECONDS = 180.0
_MIN_FREE_BYTES = 5_000_000_000

_NATIVE = {
    "numpy": "numpy",
    "scipy.spatial": "scipy",
    "numba": "numba",
    "trimesh": "trimesh",
    "pymeshlab": "pymeshlab",
    "open3d": "open3d",
    "pyrender": "pyrender",
    "OpenImageIO": "OpenImageIO",
    "fcl": "python-fcl",
    "igraph": "igraph",
    "pyarrow.parquet": "pyarrow",
    "torch": "torch",
}
"""Package of each module to import."""

_BACKENDS = ("raster", "egl")
"""What `sketches.renderer` may name: the default, which must work, and what a config may ask for."""

# pyrender uses NumPy names that no longer exist; the stages restore them before they import it.
_PRELUDE = {"pyrender": "import numpy; numpy.infty = numpy.inf; "}


@dataclass(frozen=True)
class MachineCheck:
    """One row: what was tried, its result, and the mend for a failure."""

    name: str
    state: Literal["ok", "warning", "FAILED"]
    note: str
    mend: str = ""


def examine(out: Path) -> int:
    """Print the table of all checks; return 1 if a required one fails, else 0."""
    failed = 0
    for check in machine_checks(out):
        print(f"{check.name:<14} {check.state:<8} {check.note}", flush=True)
        if check.mend:
            print(f"{'':<14} {'mend:':<8} {check.mend}", flush=True)
        failed += check.state == "FAILED"
    print(f"{failed} of these must be mended" if failed else "everything needed works")
    return int(failed > 0)


def machine_checks(out: Path) -> Iterator[MachineCheck]:
    """Yield all checks as they finish."""
    yield _python()
    yield _locked_versions()
    yield _disk(out)
    yield _shared_memory()
    with ThreadPoolExecutor(max_workers=os.cpu_count()) as pool:
        yield from pool.map(_import, _NATIVE)
        yield from pool.map(_draw, _BACKENDS)


def _python() -> MachineCheck:
    installed = platform.python_version()
    if installed.startswith("3.11."):
        return MachineCheck("python", "ok", installed)
    return MachineCheck("python", "FAILED", installed, "install Python 3.11, remove .venv, run `make setup`")


def _locked_versions() -> MachineCheck:
    pinned = [line.split("==") for line in _LOCK.read_text().splitlines() if "==" in line and not line.startswith("#")]
    wrong = []
    for name, locked in pinned:
        try:
            installed = version(name).partition("+")[0]
        except PackageNotFoundError:
            installed = "missing"
        if installed != locked:
            wrong.append(f"{name} is {installed}, not {locked}")
    if not wrong:
        return MachineCheck("versions", "ok", f"{len(pinned)} packages as in requirements.lock")
    more = f" and {len(wrong) - 3} more" if len(wrong) > 3 else ""
    mend = f"{sys.executable} -m pip install -r requirements.lock"
    return MachineCheck("versions", "FAILED", "; ".join(wrong[:3]) + more, mend)


def _disk(out: Path) -> MachineCheck:
    folder = out.absolute()
    while not folder.exists():
        folder = folder.parent
    free = shutil.disk_usage(folder).free
    if not os.access(folder, os.W_OK):
        return MachineCheck("disk", "FAILED", f"{folder} cannot be written", "choose another OUT")
    if free < _MIN_FREE_BYTES:
        mend = "free some space, or choose another OUT; each stage says what it needs before it starts"
        return MachineCheck("disk", "warning", f"{byte_size(free)} free at {folder}", mend)
    return MachineCheck("disk", "ok", f"{byte_size(free)} free at {folder}")


def _shared_memory() -> MachineCheck:
    # Workers communicate through semaphores in it.
    if os.access("/dev/shm", os.W_OK):
        return MachineCheck("workers", "ok", f"{os.cpu_count()} cores, /dev/shm can be written")
    return MachineCheck("workers", "FAILED", "/dev/shm cannot be written", "mount it: mount -t tmpfs tmpfs /dev/shm")


def _import(module: str) -> MachineCheck:
    name = _NATIVE[module]
    start = time.perf_counter()
    code, output = _try([sys.executable, "-c", f"{_PRELUDE.get(module, '')}import {module}"])
    seconds = time.perf_counter() - start
    if code == 0:
        return MachineCheck(name, "ok", f"{version(name)}, imported in {seconds:.1f} s")
    return MachineCheck(name, "FAILED", output, _mend(output, name))


def _draw(backend: str) -> MachineCheck:
    start = time.perf_counter()
    code, output = _try([sys.executable, "-m", "stages.shape.views.renderer_check", backend])
    if code == 0:
        return MachineCheck(f"draw: {backend}", "ok", f"a triangle in {time.perf_counter() - start:.1f} s by {output}")
    if backend == _BACKENDS[0]:
        return MachineCheck(f"draw: {backend}", "FAILED", output, _mend(output, "numba"))
    mend = "apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri; configs that ask for this backend do not start"
    return MachineCheck(f"draw: {backend}", "warning", output, mend)


def _try(command: list[str]) -> tuple[int, str]:
    """Return the exit code of a command, and its last line or the signal that killed it."""
    try:
        done = subprocess.run(
            command,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=_TRY_SECONDS,
            check=False,
            cwd=_HERE.parent,
        )
    except subprocess.TimeoutExpired:
        return 1, f"no answer in {_TRY_SECONDS:.0f} s"
    lines = (done.stdout + done.stderr).strip().splitlines()
    if done.returncode < 0:
        return done.returncode, f"killed by signal {-done.returncode}"
    return done.returncode, lines[-1] if lines else f"ended with code {done.returncode}"


def _mend(output: str, name: str) -> str:
    missing = re.search(r"(lib[\w.+-]+\.so[.\d]*)", output)
    if missing:
        for line in _LIBRARIES.read_text().splitlines():
            if not line.startswith("#") and line.split()[0] == missing[1]:
                return f"apt-get install {line.split()[1]}"
        return f"install the Debian package that holds {missing[1]}: apt-file search {missing[1]}"
    return f"{sys.executable} -m pip install --force-reinstall --no-deps -r requirements.lock  (or only {name} of it)"
