"""Listed kernels are compiled ahead, each once, callees first; a list that is out of date costs nothing but time."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numba
import pytest
from numba.core import types

from pipeline.kernel_folder import DAY_SECONDS, UNUSED_DAYS, all_compiled, note_all_compiled, prune_kernels
from pipeline.kernel_list import CompilationProgress, KernelList, ListedKernel, Schedule, _found, compile_ahead
from pipeline.kernel_types import argument_type, argument_words
from pipeline.make_kernel_list import merged, write_list
from pipeline.workers import Workers
from tests.pipeline.test_kernel_cache import Checkout


def listed(*kernels: tuple[list[int], float]) -> KernelList:
    rows = enumerate(kernels)
    return KernelList([ListedKernel(f"shop:k{i}", [], calls, cost, True) for i, (calls, cost) in rows], {})


def test_callees_come_first_and_of_those_that_can_be_compiled_what_most_waits_for() -> None:
    # 0 and 1 are leaves; 2 calls 0 and takes long, 3 calls both.
    kernels = listed(([], 1.0), ([], 2.0), ([0], 9.0), ([0, 1], 1.0))
    schedule = Schedule(kernels, {0, 1, 2, 3})
    assert [schedule.next(), schedule.next()] == [0, 1]
    assert not schedule.ready
    schedule.end(0)
    assert schedule.next() == 2
    assert not schedule.ready, "3 waits for 1"
    schedule.end(1)
    assert schedule.next() == 3
    assert schedule.progress == CompilationProgress(2, 4, 4.0, 15.0)


def test_kernels_that_are_compiled_already_are_waited_for_by_none() -> None:
    schedule = Schedule(listed(([], 1.0), ([0], 1.0)), {1})
    assert schedule.next() == 1


def test_stage_uses_its_kernels_and_those_that_they_call() -> None:
    kernels = listed(([], 1.0), ([0], 1.0), ([1], 1.0), ([], 1.0)).kernels
    lists = KernelList(kernels, {"variations": {"points": [2], "strings": [3]}, "programs": {"points": [3]}})
    assert lists.indices(["variations"], ["exemplars", "points"]) == [0, 1, 2]
    assert lists.indices(["programs"], ["points", "strings"]) == [3]
    assert lists.indices(["grammars"], ["points"]) == []


@numba.njit(cache=True)
def half(number: float) -> float:
    return number / 2


class Interval(NamedTuple):
    """A type of arguments with a name and fields."""

    low: int
    high: int


@pytest.mark.parametrize(
    "argument",
    [
        types.float64,
        types.boolean,
        types.none,
        types.unicode_type,
        types.Array(types.float32, 2, "C"),
        types.Array(types.int64, 1, "A", readonly=True),
        types.Array(types.boolean, 3, "F", aligned=False),
        types.UniTuple(types.int64, 3),
        types.Tuple((types.int64, types.Array(types.uint8, 1, "C"))),
        types.BaseTuple.from_types((types.int64, types.int64), Interval),
        types.Omitted(0.5),
        types.Optional(types.int64),
        types.literal(3),
        types.npy_rng,
        types.Dispatcher(half),
    ],
    ids=lambda argument: type(argument).__name__,
)
def test_type_of_an_argument_comes_back_from_its_words(argument: types.Type) -> None:
    words = json.loads(json.dumps(argument_words(argument)))
    assert argument_type(words) == argument


RING = ["tuple", "shop.records:Ring", "int64", "int64"]


@pytest.fixture
def workers(tmp_path: Path) -> Iterator[Workers]:
    started = Workers(2, tmp_path / "workers.txt")
    yield started
    started.stop(kill=True)


def test_listed_kernels_are_compiled_ahead_and_stale_entries_are_skipped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, workers: Workers
) -> None:
    shop = Checkout(tmp_path / "a", tmp_path / "cache")
    monkeypatch.setenv("XDG_CACHE_HOME", str(shop.cache))
    monkeypatch.setenv("NUMBA_CACHE_LOCATOR_CLASSES", "pipeline.kernel_cache.KernelLocator")
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.syspath_prepend(str(shop.folder))
    kernels = KernelList(
        [
            ListedKernel("shop.area:area", [RING], [], 0.1, False),
            ListedKernel("shop.total:total", [RING], [0], 0.1, True),
            ListedKernel("shop.total:removed", [RING], [], 0.1, True),
            ListedKernel("shop.total:double", [["tuple", "shop.records:Removed", "int64"]], [], 0.1, True),
            ListedKernel("shop.area:width", ["unicode_type"], [], 0.1, True),  # cannot be compiled
        ],
        {},
    )
    seen: list[CompilationProgress] = []
    assert compile_ahead(kernels, [0, 1, 2, 3, 4], workers, seen.append) == 3
    assert (seen[-1].done, seen[-1].total) == (3, 3)
    assert shop.run() == "31 8 7 compiled double width"
    assert compile_ahead(kernels, [0, 1, 2, 3], workers, seen.append) == 0


def test_set_up_compiles_the_listed_kernels_callees_first(tmp_path: Path) -> None:
    shop = Checkout(tmp_path / "a", tmp_path / "cache")
    area, total = [f"shop.{name}:{name}" for name in ("area", "total")]
    kernels = [
        ListedKernel(area, [RING], [], 0.1, False),
        ListedKernel(total, [RING], [0], 0.1, True),
        ListedKernel("shop.area:gone", [RING], [], 0.1, True),
    ]
    write_list(KernelList(kernels, {}), tmp_path / "list.json")
    code = "import sys, pathlib, pipeline.compile_kernels as c; c.main(pathlib.Path(sys.argv[1]))"
    command = [sys.executable, "-c", code, str(tmp_path / "list.json")]
    env = shop.environment | {"NUMBA_CACHE_LOCATOR_CLASSES": "pipeline.kernel_cache.KernelLocator"}
    done = subprocess.run(command, env=env, stdout=subprocess.PIPE, text=True, check=True)
    assert sorted(done.stdout.split()) == [area, "shop.area:gone", total]
    assert done.stdout.index(area) < done.stdout.index(total)
    assert shop.run() == "31 8 7 compiled double width"


def test_note_of_a_complete_cache_is_for_one_code_and_one_processor(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert not all_compiled("code")
    note_all_compiled("code")
    assert all_compiled("code")
    assert not all_compiled("other code")
    monkeypatch.setenv("NUMBA_CPU_NAME", "another")
    assert not all_compiled("code")
    monkeypatch.delenv("NUMBA_CPU_NAME")
    prune_kernels(tmp_path, time.time() + (UNUSED_DAYS + 1) * DAY_SECONDS)
    assert not all_compiled("code"), "the kernels that nobody has used since are deleted, too"


def test_record_becomes_a_list_that_keeps_other_producers(tmp_path: Path) -> None:
    before = KernelList(
        [
            ListedKernel("shop.area:area", [RING], [], 0.3, False),
            ListedKernel("shop.total:old", ["int64"], [0], 2.0, True),
        ],
        {"programs": {"points": [1]}, "variations": {"points": [1]}},
    )
    total, area = ["shop.total:total", [RING]], ["shop.area:area", [RING]]
    lines = [
        {"stage": "exemplars", "kernel": area, "calls": [], "seconds": 0.1, "is_for_python": False},
        {
            "stage": "exemplars",
            "kernel": total,
            "calls": [json.dumps(area), json.dumps(area)],
            "seconds": 1.26,
            "is_for_python": False,
        },
        {"stage": "points", "kernel": total, "calls": [], "seconds": 0.01, "is_for_python": True},  # from the cache
    ]
    after = merged(lines, "variations", before)
    write_list(after, tmp_path / "kernels.json")
    assert KernelList.read(tmp_path / "kernels.json") == after
    names = [kernel.name.partition(":")[2] for kernel in after.kernels]
    assert names[0] == "area"
    at = names.index("total")
    assert after.kernels[at] == ListedKernel("shop.total:total", [RING], [0], 1.3, True)
    assert after.kernels[0] == ListedKernel("shop.area:area", [RING], [], 0.1, False), "its time is the latest"
    assert after.used == {
        "programs": {"points": [names.index("old")]},
        "variations": {"exemplars": [0, at], "points": [at]},
    }


def test_list_is_current() -> None:
    """The whole way of `tests/test_dataset.py` looks for kernels that it lacks."""
    kernels = KernelList.read().kernels
    stale = [kernel.name for kernel in kernels if _found(kernel) is None]
    assert len(kernels) > 100
    assert len(stale) < len(kernels) / 3, f"run `make kernels`: {', '.join(stale)} no longer exist"
