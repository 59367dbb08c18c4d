"""Compiled kernels are shared by content: an edit compiles what depends on it, in any checkout, and nothing else."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pipeline.kernel_cache import _prune

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

    def start(self) -> subprocess.Popen[str]:
        env = os.environ | {"PYTHONPATH": f"{self.folder}:{ROOT}", "XDG_CACHE_HOME": str(self.cache)}
        env.pop("NUMBA_CACHE_DIR", None)
        return subprocess.Popen([sys.executable, "-m", "shop.main"], env=env, stdout=subprocess.PIPE, text=True)

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
    entries = list((checkout.cache / "shapemill/kernels").glob("*/*.nb[ci]"))
    assert len(entries) == 8, "an index and the code of four kernels"
    for content in (b"", b"torn", b"\x80\x04N."):
        for entry in entries:
            entry.write_bytes(content)
        assert checkout.run() == "31 8 7 compiled area double total width"
        assert checkout.run() == "31 8 7 compiled"


def test_entries_unused_for_a_month_are_pruned(tmp_path: Path) -> None:
    folder = tmp_path / "shop.area"
    folder.mkdir()
    for name, days in {"old.nbi": 40, "old.1.nbc": 40, "old.1.nbc.tmp.12": 40, "used.nbi": 20, "note.txt": 40}.items():
        (folder / name).touch()
        os.utime(folder / name, (0, time.time() - 86_400 * days))
    _prune(tmp_path, time.time())
    assert {path.name for path in folder.iterdir()} == {"used.nbi", "note.txt"}
    os.utime(folder / "used.nbi", (0, 0))
    _prune(tmp_path, time.time())
    assert (folder / "used.nbi").exists(), "looked through once a day"
