"""Long tables in parts: what is done outlives a kill, and is made again where anything it depends on is another."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from eval.engine.dataset_run import DatasetRun, load_dataset_run
from eval.engine.evaluation import Chart, Figure, ImageRow, TableResult
from eval.engine.results_cache import TableSection, cached_sections, join_results
from eval.engine.table import ReferenceRow, Table

ROOT = Path(__file__).resolve().parents[2]
DEFAULT = ROOT / "configs" / "default.yaml"

HOUSE = '''"""A table of two parts, the second of which is killed the first time."""
import os, signal
from functools import partial
from pathlib import Path
from eval.engine.evaluation import Answer, Evaluation, Need
from eval.engine.results_cache import Part, in_parts
from eval.engine.table import Table
def make(name, folder):
    with open(folder / "made.txt", "a") as stream:
        stream.write(name)
    if name == "b" and not (folder / "killed").exists():
        (folder / "killed").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return Answer([Table("T", ("part", "size"), ((name, 1 / 3),))])
def parts(subject, asked):
    for name in "ab":
        yield Part(name, [subject.config.path], partial(make, name, subject.out))
def options(parser):
    parser.add_argument("--slowness", type=int, default=1)
TABLE = Evaluation("Is it?", (Need("nothing", lambda _: ""),), lambda _: 1.0, in_parts(parts, options), options=options)
'''


def test_what_was_done_before_a_kill_is_not_made_again(tmp_path: Path) -> None:
    house, out = tmp_path / "house" / "eval" / "tables", tmp_path / "out"
    house.mkdir(parents=True)
    out.mkdir()
    (house / "slow.py").write_text(HOUSE)

    def run(*options: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "eval", "slow", "--config", str(DEFAULT), "--out", str(out), *options]
        environment = {**os.environ, "PYTHONPATH": str(tmp_path / "house")}
        return subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)

    def made() -> str:
        return (out / "made.txt").read_text()

    results = out / "shapemill-default-eval"
    assert run().returncode == -signal.SIGKILL
    assert [each.name for each in (results / "parts" / "slow").iterdir()] == ["a.json"]
    assert not (results / "slow.csv").exists()
    done = run()
    assert done.returncode == 0, done.stderr
    assert "a: made before" in done.stderr
    assert (results / "slow.csv").read_text() == f"part,size\na,{1 / 3}\nb,{1 / 3}\n"
    assert made() == "abb"
    run()
    assert made() == "abb"
    run("--slowness", "2")
    assert made() == "abbab", "another option"
    (house / "slow.py").write_text(HOUSE.replace("1 / 3", "1 / 4"))
    run("--slowness", "2")
    assert made() == "abbabab", "other code"


def parts_of(subject: DatasetRun, asked: Namespace) -> Iterator[TableSection]:
    def make() -> TableResult:
        asked.made.append(asked.shapes)
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

    yield TableSection("one", [subject.out / "weights"], make)


def options_of(parser: ArgumentParser) -> None:
    parser.add_argument("--shapes", type=int, default=3)


def test_an_answer_comes_back_as_it_was_and_is_made_again_where_it_may_be_another(tmp_path: Path) -> None:
    subject = load_dataset_run(DEFAULT, tmp_path)
    answer, asked = cached_sections(parts_of, options_of), Namespace(shapes=3, made=[], workers=7)
    (tmp_path / "weights").write_bytes(b"learnt")
    first, again = answer(subject, asked), answer(subject, Namespace(**{**vars(asked), "workers": 1}))
    assert asked.made == [3]
    assert again == first
    assert [type(row[1]) for row in again.tables[0].rows] == [int, float, float]
    answer(subject, Namespace(shapes=4, made=asked.made))
    answer(subject, asked)
    assert asked.made == [3, 4, 3]
    (tmp_path / "weights").write_bytes(b"learnt more")
    answer(subject, asked)
    assert asked.made == [3, 4, 3, 3]
    (kept,) = (subject.results / "parts" / "test_parts").iterdir()
    kept.write_bytes(kept.read_bytes().replace(b"2.5", b"9.5"))
    assert answer(subject, asked).tables == first.tables
    assert asked.made == [3, 4, 3, 3, 3], "what the disk has spoilt is made again"


def test_a_part_hangs_on_the_options_that_it_names(tmp_path: Path) -> None:
    made: list[str] = []

    def parts(subject: DatasetRun, asked: Namespace) -> Iterator[TableSection]:
        for name, options in (("none", ()), ("shapes", ("shapes",))):
            yield TableSection(name, [], lambda name=name: made.append(name) or TableResult([]), (), options)  # type: ignore[misc]

    answer = cached_sections(parts, options_of)
    for shapes in (1, 2, 2):
        answer(load_dataset_run(DEFAULT, tmp_path), Namespace(shapes=shapes, folder=Path("elsewhere")))
    assert made == ["none", "shapes", "shapes"]


def test_rows_and_lines_stand_together_and_what_all_say_is_said_once() -> None:
    published = [ReferenceRow("p", "s", {"b": 2.0})]
    tables = [Table("T", ("a", "b"), ((name, 1),), ("note", name), published) for name in "xy"]
    other = Table("U", ("a", "c"), ())
    curves = [Chart("C", "x", "y", {name: [(1.0, 2.0)]}) for name in "xy"]
    found = join_results([TableResult([tables[0], other], [curves[0]]), TableResult([tables[1]], [curves[1]])])
    assert [each.title for each in found.tables] == ["T", "U"]
    assert found.tables[0] == replace(tables[0], rows=(("x", 1), ("y", 1)), notes=["note", "x", "y"])
    assert list(found.curves[0].lines) == ["x", "y"]


def test_a_part_that_fails_leaves_nothing(tmp_path: Path) -> None:
    def parts(subject: DatasetRun, asked: Namespace) -> Iterator[TableSection]:
        yield TableSection("one", [], lambda: TableResult([Table("T", ("a",), ((1 / asked.shapes,),))]))

    subject = load_dataset_run(DEFAULT, tmp_path)
    with pytest.raises(ZeroDivisionError):
        cached_sections(parts, options_of)(subject, Namespace(shapes=0))
    assert not list(subject.results.rglob("*"))
