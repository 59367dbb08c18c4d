"""Compiled kernels are shared by content: an edit compiles what depends on it, in any checkout, and nothing else."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pipeline import kernel_cache
from pipeline.kernel_cache import _lock
from pipeline.kernel_folder import prune_kernels

ROOT = Path(__file__).resolve().parents[2]

SOURCES = {
    "radii.py": "STEP = 3\nUNRELATED = 5\nTABLE = [1, 2]\nTABLE[1] = 7\nWIDTHS = tuple(TABLE)\n",
    "records.py": "from typing import NamedTuple\nclass Ring(NamedTuple):\n    inner: int\n    outer: int\n",
    "area.py": """
import numba
from . import radii
from shop.radii import STEP as step
@numba.njit(cache=True)
def area(ring):
    return (ring.outer - ring.inner) * step
@numba.njit(cache=True)
def width(index):
    return radii.WIDTHS[index]
""",
    "total.py": """
import numba
from shop.area import area
from shop.records import Ring
@numba.njit(cache=True)
def total(ring):
    return area(ring) + 1
@numba.njit(cache=True)
def double(number):
    return number * 2
""",
    "main.py": """
import stages
from shop.area import area, width
from shop.total import Ring, double, total
print(total(Ring(2, 12)), double(4), width(1), end="")
compiled = [kernel.__name__ for kernel in (total, area, double, width) if kernel.stats.cache_misses]
print("", "compiled", *sorted(compiled))
""",
}


class Checkout:
    """A source tree with kernels that use one another over files."""

    def __init__(self, folder: Path, cache: Path) -> None:
        self.folder, self.cache = folder, cache
        (folder / "shop").mkdir(parents=True)
        (folder / "shop/__init__.py").touch()
        for name, text in SOURCES.items():
            (folder / "shop" / name).write_text(text, encoding="utf-8")

    def edit(self, name: str, old: str, new: str) -> None:
        path = self.folder / "shop" / name
        text = path.read_text(encoding="utf-8")
        assert old in text
        path.write_text(text.replace(old, new), encoding="utf-8")

    @property
    def environment(self) -> dict[str, str]:
        env = os.environ | {"PYTHONPATH": f"{self.folder}:{ROOT}", "XDG_CACHE_HOME": str(self.cache)}
        # Python takes a .pyc for current when size and second of the source agree, as after a quick edit.
        env["PYTHONDONTWRITEBYTECODE"] = "1"
        env.pop("NUMBA_CACHE_DIR", None)
        return env

    def start(self, module: str = "main") -> subprocess.Popen[str]:
        command = [sys.executable, "-m", f"shop.{module}"]
        return subprocess.Popen(command, env=self.environment, stdout=subprocess.PIPE, text=True)

    def run(self) -> str:
        process = self.start()
        said = process.communicate()[0].strip()
        assert process.returncode == 0
        return said


@pytest.fixture
def checkout(tmp_path: Path) -> Checkout:
    return Checkout(tmp_path / "a", tmp_path / "cache")


def test_edit_compiles_what_depends_on_it(checkout: Checkout, tmp_path: Path) -> None:
    assert checkout.run() == "31 8 7 compiled area double total width"
    assert checkout.run() == "31 8 7 compiled"
    assert Checkout(tmp_path / "b", checkout.cache).run() == "31 8 7 compiled", "another checkout shares"

    checkout.edit("area.py", "def area(ring):", "\n\ndef area(ring):  # a line further down\n    'The area.'")
    assert checkout.run() == "31 8 7 compiled", "comments and docstrings are no code"
    checkout.edit("radii.py", "UNRELATED = 5", "UNRELATED = 6")
    assert "area" not in checkout.run(), "a constant that the kernel does not read"

    checkout.edit("area.py", "ring.outer - ring.inner", "ring.outer + ring.inner")
    assert checkout.run() == "43 8 7 compiled area total", "the caller in another file is compiled again"
    checkout.edit("radii.py", "STEP = 3", "STEP = 4")
    assert checkout.run().startswith("57 8 7 compiled area total"), "so is the reader of a constant"
    checkout.edit("radii.py", "TABLE[1] = 7", "TABLE[1] = 9")
    assert checkout.run() == "57 8 9 compiled width"
    assert Checkout(tmp_path / "c", checkout.cache).run() == "31 8 7 compiled", "the old state has kept its entries"


def test_fields_of_an_argument_count(checkout: Checkout) -> None:
    """Numba takes named tuples of one class for equal whatever the order of their fields."""
    assert checkout.run() == "31 8 7 compiled area double total width"
    checkout.edit("records.py", "    inner: int\n    outer: int\n", "    outer: int\n    inner: int\n")
    assert checkout.run() == "-29 8 7 compiled area total"
    checkout.edit("records.py", "class Ring", "class Circle")
    checkout.edit("total.py", "import Ring", "import Circle as Ring")
    assert checkout.run() == "-29 8 7 compiled area total"


def test_concurrent_processes_and_corrupted_entries_do_no_harm(checkout: Checkout) -> None:
    together = [checkout.start() for _ in range(3)]
    assert {process.communicate()[0].partition(" compiled")[0] for process in together} == {"31 8 7"}
    folder = checkout.cache / "shapemill/kernels"
    indices, codes = (sorted(folder.glob(f"*/*.{suffix}")) for suffix in ("nbi", "nbc"))
    assert len(indices) == len(codes) == 4, "an index and the code of four kernels"
    for index, content in zip(indices, (b"", b"torn", b"\x80\x04N."), strict=False):
        index.write_bytes(content)
    codes[3].write_bytes(b"torn")
    assert checkout.run() == "31 8 7 compiled area double total width"
    assert checkout.run() == "31 8 7 compiled"


def test_python_can_call_a_kernel_that_a_kernel_called_before(checkout: Checkout) -> None:
    """The first call compiles it without a wrapper for Python, and a call without one would end the process."""
    use = "import stages\nfrom shop.main import *\nprint(area(Ring(2, 12)), sum(area.stats.cache_misses.values()))"
    (checkout.folder / "shop/use.py").write_text(use, encoding="utf-8")

    def used() -> str:
        return checkout.start("use").communicate()[0].splitlines()[1]

    assert used() == "30 2", "once for its caller, once for Python"
    assert used() == "30 0"
    indices = list(checkout.cache.rglob("*.area-*.nbi"))
    assert len(indices) == 2
    checkout.edit("main.py", "print(total(Ring(2, 12))", "area(Ring(2, 12))\nprint(total(Ring(2, 12))")
    checkout.edit("area.py", "ring.outer - ring.inner", "ring.outer + ring.inner")
    assert used() == "42 1", "where Python comes first, its entry is enough"


SLOW_KERNEL = """
import os, time
import numba
from numba.extending import overload

def pause():
    pass

@overload(pause)
def _pause():
    with open(os.path.dirname(__file__) + "/compilations", "a") as log:
        log.write(f"{os.getpid()}\\n")
    until = time.monotonic() + 60
    while not os.path.exists(os.path.dirname(__file__) + "/go") and time.monotonic() < until:
        time.sleep(0.01)
    if "FAIL" in os.environ:
        raise numba.TypingError("it fails")
    return lambda: 0

@numba.njit(cache=True)
def inner(number):
    pause()
    return number + 1

@numba.njit(cache=True)
def outer(number):
    return inner(number) * 2

@numba.njit(cache=True)
def other(number):
    return inner(number) * 3
"""

USE_OF_SLOW_KERNEL = """
import os, stages
from pathlib import Path
from pipeline.compilation_note import compilation_noted_in
from shop.slow import inner, other, outer

with compilation_noted_in(Path(__file__).with_name(f"note-{os.getpid()}")):
    kernels = (other, outer) if "OTHER" in os.environ else (outer, other)
    print(*(kernel(20) for kernel in kernels), sum(inner.stats.cache_misses.values()))
"""


@pytest.fixture
def slow(checkout: Checkout) -> Checkout:
    """Return a checkout with a kernel whose compilation lasts until there is a file `go`."""
    (checkout.folder / "shop/slow.py").write_text(SLOW_KERNEL, encoding="utf-8")
    (checkout.folder / "shop/use.py").write_text(USE_OF_SLOW_KERNEL, encoding="utf-8")
    return checkout


def begun(checkout: Checkout, count: int = 1) -> list[int]:
    """Wait until the slow kernel has begun to be compiled `count` times; return the processes that did."""
    log = checkout.folder / "shop/compilations"
    until = time.monotonic() + 60
    while time.monotonic() < until and (not log.exists() or log.read_text(encoding="utf-8").count("\n") < count):
        time.sleep(0.01)
    return [int(line) for line in log.read_text(encoding="utf-8").split()]


def locks(checkout: Checkout) -> list[Path]:
    return list(checkout.cache.rglob("*.lock"))


def notes(checkout: Checkout) -> int:
    return len(list((checkout.folder / "shop").glob("note-*")))


def test_kernel_that_processes_need_at_the_same_time_is_compiled_once(
    slow: Checkout, monkeypatch: pytest.MonkeyPatch
) -> None:
    together = [slow.start("use") for _ in range(2)]
    monkeypatch.setenv("OTHER", "1")
    together.append(slow.start("use"))
    while notes(slow) < 3 and any(process.poll() is None for process in together):
        time.sleep(0.01)
    assert notes(slow) == 3, "the waiting processes note it, too"
    (slow.folder / "shop/go").touch()
    answers = sorted(process.communicate(timeout=60)[0] for process in together)
    assert [answer.split()[:2] for answer in answers] == [["42", "63"], ["42", "63"], ["63", "42"]]
    assert sorted(int(answer.split()[2]) for answer in answers) == [0, 0, 1]
    assert len(begun(slow)) == 1
    assert notes(slow) == len(locks(slow)) == 0
    assert len(list(slow.cache.rglob("*.nb[ci]"))) == 6


def test_process_that_waits_for_a_killed_one_compiles_by_itself(slow: Checkout) -> None:
    first = slow.start("use")
    assert begun(slow) == [first.pid]
    second = slow.start("use")
    while notes(slow) < 2 and second.poll() is None:
        time.sleep(0.01)
    first.kill()
    (slow.folder / "shop/go").touch()
    assert second.communicate(timeout=60)[0].split() == ["42", "63", "1"]
    assert begun(slow, 2) == [first.pid, second.pid]
    assert not locks(slow)
    first.communicate()


def test_process_whose_compilation_fails_does_not_keep_others_waiting(
    slow: Checkout, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FAIL", "1")
    first = slow.start("use")
    begun(slow)
    monkeypatch.delenv("FAIL")
    second = slow.start("use")
    while notes(slow) < 2 and second.poll() is None:
        time.sleep(0.01)
    (slow.folder / "shop/go").touch()
    assert second.communicate(timeout=60)[0].split() == ["42", "63", "1"]
    assert first.wait(timeout=60) == 1
    assert not locks(slow)


def test_kernels_are_compiled_where_nothing_can_be_locked(slow: Checkout) -> None:
    (slow.folder / "shop/go").touch()
    no_locks = "import errno, fcntl\ndef flock(*_): raise OSError(errno.ENOLCK, 'no locks')\nfcntl.flock = flock\n"
    (slow.folder / "shop/use.py").write_text(no_locks + USE_OF_SLOW_KERNEL, encoding="utf-8")
    assert slow.start("use").communicate(timeout=60)[0].split() == ["42", "63", "1"]
    assert slow.start("use").communicate(timeout=60)[0].split() == ["42", "63", "0"]


def test_wait_for_a_lock_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    index = tmp_path / "kernel.nbi"
    held = _lock(index)
    assert held is not None
    monkeypatch.setattr(kernel_cache, "MAX_WAIT_SECONDS", 0.2)
    assert _lock(index) is None, "as if a stopped process held it"
    held.release()
    after = _lock(index)
    assert after is not None
    after.release()
    assert not list(tmp_path.iterdir())


def test_entries_unused_for_a_month_are_pruned(tmp_path: Path) -> None:
    folder = tmp_path / "shop.area"
    folder.mkdir()
    for name, days in {"old.nbi": 40, "old.1.nbc": 40, "old.1.nbc.tmp.12": 40, "used.nbi": 20, "note.txt": 40}.items():
        (folder / name).touch()
        os.utime(folder / name, (0, time.time() - 86_400 * days))
    prune_kernels(tmp_path, time.time())
    assert {path.name for path in folder.iterdir()} == {"used.nbi", "note.txt"}
    os.utime(folder / "used.nbi", (0, 0))
    prune_kernels(tmp_path, time.time())
    assert (folder / "used.nbi").exists(), "looked through once a day"
