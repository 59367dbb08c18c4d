"""The cache of sections survives kills, and its results are computed again when an input changes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from eval.engine.dataset_run import DatasetRun, load_dataset_run
from eval.engine.evaluation import Chart, Figure, ImageRow, TableResult
from eval.engine.results_cache import TableSection, cached_sections, join_results
from eval.engine.table import ReferenceRow, Table
from pipeline.config import StrictModel

ROOT = Path(__file__).resolve().parents[3]
DEFAULT = ROOT / "configs" / "default.yaml"

TABLE = '''"""A table of two sections; the second is killed the first time."""
import os, signal
from functools import partial
from pathlib import Path
from eval.engine.evaluation import Evaluation, Requirement, TableResult
from eval.engine.results_cache import TableSection, cached_sections
from eval.engine.table import Table
from pipeline.config import StrictModel
def compute(name, folder):
    with open(folder / "made.txt", "a") as stream:
        stream.write(name)
    if name == "b" and not (folder / "killed").exists():
        (folder / "killed").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return TableResult([Table("T", ("part", "size"), ((name, 1 / 3),))])
def sections(run, options):
    for name in "ab":
        yield TableSection(name, [run.config.path], partial(compute, name, run.out))
class Options(StrictModel):
    slowness: int = 1
TABLE = Evaluation(
    "Is it?", (Requirement("nothing", lambda _: ""),), lambda _: 1.0, cached_sections(sections), options=Options
)
'''


def test_finished_sections_survive_a_kill(tmp_path: Path) -> None:
    tables, out = tmp_path / "extension" / "eval" / "tables", tmp_path / "out"
    tables.mkdir(parents=True)
    out.mkdir()
    (tables / "slow.py").write_text(TABLE, encoding="utf-8")

    def run(*options: str) -> subprocess.CompletedProcess[str]:
        command = [
            sys.executable,
            "-m",
            "pipeline",
            "eval",
            "slow",
            "--config",
            str(DEFAULT),
            "--out",
            str(out),
            *options,
        ]
        environment = {**os.environ, "PYTHONPATH": str(tmp_path / "extension")}
        return subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)

    def made() -> str:
        return (out / "made.txt").read_text(encoding="utf-8")

    results = out / "shapemill-default-eval"
    assert run().returncode == -signal.SIGKILL
    assert [path.name for path in (results / "cache" / "slow").iterdir()] == ["a.json"]
    assert not (results / "slow.csv").exists()
    done = run()
    assert done.returncode == 0, done.stderr
    assert "a: cached" in done.stderr
    assert (results / "slow.csv").read_text(encoding="utf-8") == f"part,size\na,{1 / 3}\nb,{1 / 3}\n"
    assert made() == "abb"
    run()
    assert made() == "abb"
    run("--set", "slowness=2")
    assert made() == "abbab", "another option"
    (tables / "slow.py").write_text(TABLE.replace("1 / 3", "1 / 4"), encoding="utf-8")
    run("--set", "slowness=2")
    assert made() == "abbabab", "other code"


MADE: list[int] = []


class Options(StrictModel):
    shapes: int = 3
    folder: str = ""


def sections(run: DatasetRun, options: Options) -> Iterator[TableSection]:
    def compute() -> TableResult:
        MADE.append(options.shapes)
        return TableResult(
            [
                Table(
                    "T",
                    ("a", "b"),
                    (("x", 1), ("y", 1.0), ("z", float("inf"))),
                    (),
                    [ReferenceRow("p", "s", {"b": 2.5})],
                )
            ],
            [Chart("C", "x", "y", {"line": [(1.0, 0.1)]})],
            [ImageRow("S", [("caption", b"\x89PNG\xff")])],
            [Figure("drawn", "D", bytes(range(256)))],
        )

    yield TableSection("one", [run.out / "weights"], compute)


def test_cached_result_is_equal_and_recomputed_after_changes(tmp_path: Path) -> None:
    run = load_dataset_run(DEFAULT, tmp_path)
    compute, options = cached_sections(sections), Options()
    MADE.clear()
    (tmp_path / "weights").write_bytes(b"trained")
    first, again = compute(run, options), compute(replace(run, workers=7), options)
    assert MADE == [3]
    assert again == first
    assert [type(row[1]) for row in again.tables[0].rows] == [int, float, float]
    compute(run, Options(shapes=4))
    compute(run, options)
    assert MADE == [3, 4, 3]
    (tmp_path / "weights").write_bytes(b"trained more")
    compute(run, options)
    assert MADE == [3, 4, 3, 3]
    (cached,) = (run.results / "cache" / "test_results_cache").iterdir()
    cached.write_bytes(cached.read_bytes().replace(b"2.5", b"9.5"))
    assert compute(run, options).tables == first.tables
    assert MADE == [3, 4, 3, 3, 3], "a corrupted file is computed again"


def test_section_depends_on_the_options_that_it_names(tmp_path: Path) -> None:
    made: list[str] = []

    def of_options(run: DatasetRun, options: Options) -> Iterator[TableSection]:
        for name, names in (("none", ()), ("shapes", ("shapes",))):
            yield TableSection(name, [], lambda name=name: made.append(name) or TableResult([]), (), names)  # type: ignore[misc]

    compute = cached_sections(of_options)
    for number, shapes in enumerate((1, 2, 2)):
        compute(load_dataset_run(DEFAULT, tmp_path), Options(shapes=shapes, folder=str(number)))
    assert made == ["none", "shapes", "shapes"]


def test_joined_results_share_tables_charts_and_notes() -> None:
    published = [ReferenceRow("p", "s", {"b": 2.0})]
    tables = [Table("T", ("a", "b"), ((name, 1),), ("note", name), published) for name in "xy"]
    other = Table("U", ("a", "c"), ())
    charts = [Chart("C", "x", "y", {name: [(1.0, 2.0)]}) for name in "xy"]
    joined = join_results([TableResult([tables[0], other], [charts[0]]), TableResult([tables[1]], [charts[1]])])
    assert [table.title for table in joined.tables] == ["T", "U"]
    assert joined.tables[0] == replace(tables[0], rows=(("x", 1), ("y", 1)), notes=["note", "x", "y"])
    assert list(joined.charts[0].lines) == ["x", "y"]


def test_failing_section_leaves_no_file(tmp_path: Path) -> None:
    def of_zero(run: DatasetRun, options: Options) -> Iterator[TableSection]:
        yield TableSection("one", [], lambda: TableResult([Table("T", ("a",), ((1 / options.shapes,),))]))

    run = load_dataset_run(DEFAULT, tmp_path)
    with pytest.raises(ZeroDivisionError):
        cached_sections(of_zero)(run, Options(shapes=0))
    assert not list(run.results.rglob("*"))
