"""`shapemill doctor`: try everything that Shapemill needs on this machine, with the remedy for what fails.

Each library is imported, and each renderer draws a triangle, in a process of its own: a crash is a row of the table.
"""

from __future__ import annotations

import os
import platform
import re
import shutil
import subprocess
import sys
import sysconfig
import time
import tomllib
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path
from typing import Literal

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from pipeline.disk_space import byte_size
from pipeline.shared_memory import REMEDY, semaphore_fault

_HERE = Path(__file__).parent
_LOCK = _HERE.parent / "requirements.lock"
_LIBRARIES = _HERE / "libraries.txt"
_PROJECT = _HERE.parent / "pyproject.toml"
_TRY_SECONDS = 180.0
_MIN_FREE_BYTES = 5_000_000_000
_MIN_SHARED_BYTES_PER_CORE = 100_000
_PYTHONS = ("3.11", "3.12", "3.13")
_OPTIONAL_GROUPS = ("models", "cluster", "dev")

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
}
"""Package of each module to import."""

_OF_MODELS = {"torch": "torch"}
"""The same for the group `models`."""

_BACKENDS = ("raster", "egl")
"""What `sketches.renderer` may name: the default, which must work, and what a config may ask for."""

# pyrender uses NumPy names that no longer exist; the stages restore them before they import it.
_PRELUDE = {"pyrender": "import numpy; numpy.infty = numpy.inf; "}


@dataclass(frozen=True)
class MachineCheck:
    """One row: what was tried, its result, and the remedy for a failure."""

    name: str
    state: Literal["ok", "warning", "FAILED"]
    note: str
    remedy: str = ""


def examine(out: Path) -> int:
    """Print the table of all checks; return 1 if a required one fails, else 0."""
    failed = 0
    for check in machine_checks(out):
        print(f"{check.name:<14} {check.state:<8} {check.note}", flush=True)
        if check.remedy:
            print(f"{'':<14} {'remedy:':<8} {check.remedy}", flush=True)
        failed += check.state == "FAILED"
    print(f"{failed} checks failed" if failed else "everything needed works")
    return int(failed > 0)


def machine_checks(out: Path) -> Iterator[MachineCheck]:
    """Yield all checks as they finish."""
    groups = installed_groups()
    yield _python()
    yield _locked_versions(groups)
    yield _disk(out)
    yield _shared_memory()
    with ThreadPoolExecutor(max_workers=os.cpu_count()) as pool:
        yield from pool.map(_import, [*_NATIVE, *(_OF_MODELS if "models" in groups else ())])
        yield from pool.map(_draw, _BACKENDS)


def _python() -> MachineCheck:
    installed = platform.python_version()
    if installed.rpartition(".")[0] in _PYTHONS:
        return MachineCheck("python", "ok", installed)
    remedy = f"install Python {', '.join(_PYTHONS[:-1])} or {_PYTHONS[-1]}, remove .venv, run `make setup`"
    return MachineCheck("python", "FAILED", installed, remedy)


def installed_groups() -> list[str]:
    """Return the optional groups of pyproject.toml whose packages are all installed."""
    wanted = _wanted_packages()
    return [group for group in _OPTIONAL_GROUPS if all(_installed(package) for package in wanted[group])]


def _locked_versions(groups: list[str]) -> MachineCheck:
    """Compare installed versions with the lock; only packages that the core and `groups` need may not be missing."""
    lines = [line for line in _LOCK.read_text(encoding="utf-8").splitlines() if not line.startswith(("#", "-"))]
    pinned = {canonicalize_name(package): locked for package, _, locked in (line.partition("==") for line in lines)}
    wanted = _wanted_packages()
    needed = _with_dependencies([*wanted["core"], *(package for group in groups for package in wanted[group])])
    wrong, right = [], 0
    for package, locked in pinned.items():
        installed = _installed(package)
        if installed == locked:
            right += 1
        elif installed or package in needed:
            wrong.append(f"{package} is {installed or 'missing'}, not {locked}")
    absent = [group for group in _OPTIONAL_GROUPS if group not in groups]
    note = f"; groups {', '.join(['core', *groups])}" + (f"; not installed: {', '.join(absent)}" if absent else "")
    if not wrong:
        return MachineCheck("versions", "ok", f"{right} packages as in requirements.lock{note}")
    more = f" and {len(wrong) - 3} more" if len(wrong) > 3 else ""
    remedy = " ".join(["pipeline/setup.sh", *groups])
    return MachineCheck("versions", "FAILED", "; ".join(wrong[:3]) + more + note, remedy)


def _wanted_packages() -> dict[str, list[str]]:
    """Return the packages that pyproject.toml asks for, by group; `core` are those that every command needs."""
    project = tomllib.loads(_PROJECT.read_text(encoding="utf-8"))["project"]
    groups = {"core": project["dependencies"], **project["optional-dependencies"]}
    return {group: list(_here(requirements)) for group, requirements in groups.items()}


def _with_dependencies(packages: list[str]) -> set[str]:
    """Return packages with all that they need in turn; the needs of a package's extras are left out."""
    reached: set[str] = set()
    waiting = list(packages)
    while waiting:
        package = waiting.pop()
        if package not in reached:
            reached.add(package)
            waiting += _here(requires(package) or ()) if _installed(package) else ()
    return reached


def _here(requirements: Iterable[str]) -> Iterator[str]:
    """Yield the packages that requirements ask for on this machine and Python."""
    for requirement in map(Requirement, requirements):
        if requirement.marker is None or requirement.marker.evaluate({"extra": ""}):
            yield canonicalize_name(requirement.name)


def _installed(package: str) -> str:
    """Return the installed version of a package without its build, such as `2.13.0`; empty without one."""
    try:
        return version(package).partition("+")[0]
    except PackageNotFoundError:
        return ""


def _disk(out: Path) -> MachineCheck:
    folder = out.absolute()
    while not folder.exists():
        folder = folder.parent
    free = shutil.disk_usage(folder).free
    if not os.access(folder, os.W_OK):
        return MachineCheck("disk", "FAILED", f"{folder} cannot be written", "choose another OUT")
    if free < _MIN_FREE_BYTES:
        remedy = "free some space, or choose another OUT; each stage says what it needs before it starts"
        return MachineCheck("disk", "warning", f"{byte_size(free)} free at {folder}", remedy)
    return MachineCheck("disk", "ok", f"{byte_size(free)} free at {folder}")


def _shared_memory() -> MachineCheck:
    # Workers communicate through semaphores in it.
    fault, cores = semaphore_fault(), os.cpu_count() or 1
    if fault:
        return MachineCheck("workers", "FAILED", f"/dev/shm cannot hold semaphores: {fault}", REMEDY)
    free = shutil.disk_usage("/dev/shm").free
    if free < cores * _MIN_SHARED_BYTES_PER_CORE:
        return MachineCheck("workers", "FAILED", f"{byte_size(free)} free in /dev/shm for {cores} cores", REMEDY)
    return MachineCheck("workers", "ok", f"{cores} cores, /dev/shm can be written")


def _import(module: str) -> MachineCheck:
    name = (_NATIVE | _OF_MODELS)[module]
    start = time.perf_counter()
    command = f"{_PRELUDE.get(module, '')}import {module}; print(); print({module}.__file__)"
    code, output = _try([sys.executable, "-c", command])
    seconds = time.perf_counter() - start
    if code != 0:
        return MachineCheck(name, "FAILED", output, _remedy(output, name))
    packages = Path(sysconfig.get_path("purelib"))
    if not Path(output).resolve().is_relative_to(packages.resolve()):
        remedy = "unset PYTHONPATH; if it is not set, remove .venv and run `make setup`"
        return MachineCheck(name, "FAILED", f"imported from {output}, not from {packages}", remedy)
    return MachineCheck(name, "ok", f"{version(name)}, imported in {seconds:.1f} s")


def _draw(backend: str) -> MachineCheck:
    start = time.perf_counter()
    code, output = _try([sys.executable, "-m", "stages.shape.views.renderer_check", backend])
    if code == 0:
        return MachineCheck(f"draw: {backend}", "ok", f"a triangle in {time.perf_counter() - start:.1f} s by {output}")
    if backend == _BACKENDS[0]:
        return MachineCheck(f"draw: {backend}", "FAILED", output, _remedy(output, "numba"))
    remedy = "apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri; configs that ask for this backend do not start"
    return MachineCheck(f"draw: {backend}", "warning", output, remedy)


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


def _remedy(output: str, name: str) -> str:
    missing = re.search(r"(lib[\w.+-]+\.so[.\d]*)", output)
    if missing:
        for line in _LIBRARIES.read_text(encoding="utf-8").splitlines():
            if not line.startswith("#") and line.split()[0] == missing[1]:
                return f"apt-get install {line.split()[1]}"
        return f"install the Debian package that holds {missing[1]}: apt-file search {missing[1]}"
    return f"{sys.executable} -m pip install --force-reinstall --no-deps --constraint requirements.lock {name}"
