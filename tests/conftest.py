"""What all tests share: properties are tried on the same examples in every run, and none is timed."""

from __future__ import annotations

import gc
import os
import subprocess
import sys

# As in workers of the engine: with several threads on a busy machine LAPACK is a hundred times slower. Before numpy is
# imported; torch heeds OMP.
os.environ.update(dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"))

from collections.abc import Iterator
from contextlib import nullcontext
from functools import cache
from importlib.util import cache_from_source, find_spec
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from tests.warm_workers import warm_workers

# A busy machine must not fail a test, and a failure must come back when the tests are run again.
settings.register_profile("shapemill", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("shapemill")

_WITH_WARM_WORKERS = {
    Path(__file__).parent / name
    for name in ("stages", "eval", "pipeline/test_damage.py", "pipeline/test_prune.py", "pipeline/test_run.py")
}
"""Folders and files of tests that run stages and do not test how workers start and end."""

_COMPILED_FIRST = """
import compileall
import torch, open3d, trimesh, matplotlib.pyplot, pyrender, pyarrow.parquet, numba, scipy.optimize, networkx
import distributed, mlcroissant
for package in ("pipeline", "stages", "eval"):
    compileall.compile_dir(package, quiet=1)
"""
"""A program that imports what most test files import, and compiles the project."""


def pytest_configure(config: pytest.Config) -> None:
    # Python compiles the modules of a new environment at their first import, for 10 CPU seconds. Workers, which start
    # at the same time, would each do so.
    torch = find_spec("torch")
    is_new = torch is not None and not Path(cache_from_source(str(torch.origin))).exists()
    if is_new and config.getoption("numprocesses", None) and not sys.dont_write_bytecode:
        subprocess.run([sys.executable, "-c", _COMPILED_FIRST], cwd=config.rootpath, check=False)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    # Imports make 750,000 objects that stay to the end. No full garbage collection needs to look through them. Tests
    # make trees, JSON and meshes, and few circles of references: collections after 700 new objects find nothing.
    gc.disable()
    try:
        return (yield)
    finally:
        gc.set_threshold(20_000, 10, 10)
        gc.enable()
        gc.freeze()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    # Around fixtures, too: most of them make a dataset for all tests of a file.
    with warm_workers() if _WITH_WARM_WORKERS & {item.path, *item.path.parents} else nullcontext():
        return (yield)


@cache
def no_egl() -> str | None:
    from stages.shape.views.renderer_check import check_triangle

    return check_triangle("egl")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    # Files with slow tests first, so that no worker is left alone with one of them at the end.
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)


def pytest_runtest_setup(item: pytest.Item) -> None:
    # Not while tests are collected, which every worker does: a first drawing takes seconds.
    if item.get_closest_marker("egl") and no_egl():
        pytest.skip(f"no OpenGL context on EGL here: {no_egl()}")
