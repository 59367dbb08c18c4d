"""Tables are found, name their requirements, and have reference rows."""

from __future__ import annotations

import csv
import io
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from eval.engine.dataset_run import DatasetRun, load_dataset_run
from eval.engine.evaluation import Evaluation
from eval.engine.registry import read_tables
from eval.engine.requirements import FINISHED_DATASET, KITS, STRING_VAE
from eval.engine.table import ReferenceRow, Table
from tests.command import shapemill

ROOT = Path(__file__).resolve().parents[2]
DEFAULT, CHAIRS = ROOT / "configs" / "default.yaml", ROOT / "configs" / "chairs.yaml"


def test_every_module_is_a_table_with_question_and_requirements() -> None:
    tables = read_tables()[0]
    assert list(tables) == sorted(path.stem for path in (ROOT / "eval" / "tables").glob("[!_]*.py"))
    for table in tables.values():
        assert isinstance(table, Evaluation)
        assert table.question.endswith("?")
        assert table.requirements


def test_unreadable_tables_are_reported_and_others_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "other_tables").mkdir()
    (tmp_path / "other_tables" / "__init__.py").touch()
    faulty = {"unnamed": "import math\nmath.nothing\n", "unparsed": "import math\n\ndef (\n", "wrong": "TABLE = 3\n"}
    for name, text in faulty.items():
        (tmp_path / "other_tables" / f"{name}.py").write_text(text, encoding="utf-8")
    (tmp_path / "other_tables" / "sound.py").write_text("from eval.tables.physical import TABLE\n", encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    tables, faults = read_tables("other_tables")
    assert list(tables) == ["sound"]
    assert list(faults) == list(faulty)
    assert "other_tables/wrong.py must hold TABLE" in faults["wrong"]
    assert "other_tables/unparsed.py:3: SyntaxError: " in faults["unparsed"]
    assert "other_tables/unnamed.py:2: AttributeError: " in faults["unnamed"]
    for name in ("other_tables", *(f"other_tables.{name}" for name in (*faulty, "sound"))):
        sys.modules.pop(name, None)


def finished(out: Path, config: Path) -> DatasetRun:
    """Return the run of a dataset that has only a manifest."""
    run = load_dataset_run(config, out)
    run.folder.mkdir(parents=True)
    (run.folder / "manifest.json").write_text(json.dumps({"samples": 1200}), encoding="utf-8")
    return run


def test_missing_requirement_names_the_command_that_makes_it(tmp_path: Path) -> None:
    nothing = load_dataset_run(DEFAULT, tmp_path)
    assert "make dataset" in FINISHED_DATASET.missing(nothing)
    assert "make exemplars" in KITS.missing(nothing)
    assert "no shape graphs" in KITS.missing(load_dataset_run(CHAIRS, tmp_path))
    assert FINISHED_DATASET.missing(finished(tmp_path, DEFAULT)) == ""
    assert "make train" in STRING_VAE.missing(nothing)
    (nothing.models / "masked-castle-0").mkdir(parents=True)
    assert "make train" in STRING_VAE.missing(nothing), "an empty folder is no model"
    (nothing.models / "masked-castle-0" / "weights.safetensors").touch()
    assert STRING_VAE.missing(nothing) == ""


def test_list_of_tables_shows_missing_requirements(tmp_path: Path) -> None:
    arguments = ["--config", str(DEFAULT), "--out", str(tmp_path)]
    code, printed = shapemill("eval", *arguments)
    assert code == 0
    before = printed
    for name, table in read_tables()[0].items():
        assert f"  {name} " in before
        assert table.question in before
    assert before.count("missing:") == len(read_tables()[0])
    finished(tmp_path, DEFAULT)
    code, printed = shapemill("eval", *arguments, "--", "")
    assert code == 0
    after = printed
    assert "1,200 shapes" in after
    assert after.count("can be made, takes about") >= 2


def test_unknown_table_names_the_nearest() -> None:
    code, printed = shapemill("eval", "physicl")
    assert code == 2
    assert "did you mean physical?" in printed


def test_table_about_datasets_refuses_files(tmp_path: Path) -> None:
    code, printed = shapemill("eval", "near_duplicates", str(tmp_path / "a.glb"))
    assert code == 2
    assert "not about files" in printed
    assert f"leave out {tmp_path / 'a.glb'} (MESH), or name a table about files: decomposition, generation" in printed


@pytest.mark.parametrize("table", ["", "all"])
def test_files_need_the_name_of_a_table(tmp_path: Path, table: str) -> None:
    code, printed = shapemill("eval", "--", table, str(tmp_path / "a.glb"))
    assert code == 2
    assert "a table is about files where it is named" in printed


def test_table_reads_two_sets_from_one_value_of_mesh(tmp_path: Path) -> None:
    clouds = np.random.default_rng(0).normal(size=(3, 80, 3))
    paths = [tmp_path / name for name in ("generated.npy", "reference.npy")]
    for path in paths:
        np.save(path, clouds)
    options = ("--set", "points=64", "--set", "emd_points=16", "--workers", "1")
    code, printed = shapemill("eval", *options, "--", "generation", f"{paths[0]} {paths[1]}")
    assert code == 0, printed
    assert "generated.npy" in printed


def test_reference_rows_follow_ours_with_their_source_in_every_format() -> None:
    published = (
        ReferenceRow("sand castle, naive", "strings Table 2", {"average": 4.71, "greatest": 12.17}),
        ReferenceRow("chair", "shapeassembly Table 5", {"average": 9.7}),
    )
    table = Table("T", ("kit", "components", "average", "greatest"), (("castle", 1, 0.5, 1.1),), (), published)
    rows = list(csv.reader(io.StringIO(table.csv())))
    assert rows[1:] == [
        ["castle", "1", "0.5", "1.1"],
        ["sand castle, naive (strings Table 2)", "", "4.71", "12.17"],
        ["chair (shapeassembly Table 5)", "", "9.7", ""],
    ]
    assert "| sand castle, naive (strings Table 2) |  | 4.71 | 12.2 |" in table.markdown()
    assert table.latex().count(r"\midrule") == 2
    assert list(table.references_by_source()) == ["strings Table 2", "shapeassembly Table 5"]


def test_reference_value_needs_a_column() -> None:
    with pytest.raises(ValueError, match="strings Table 2 has depth, which is no column of T"):
        Table("T", ("kit", "size"), (), (), (ReferenceRow("a", "strings Table 2", {"depth": 1}),))


def test_failing_table_is_reported_and_others_are_made(tmp_path: Path) -> None:
    """An extension has a table that fails; the tables of the project lack their dataset."""
    tables = tmp_path / "extension" / "eval" / "tables"
    tables.mkdir(parents=True)
    text = (
        "from eval.engine.evaluation import Evaluation, Figure, Requirement, TableResult\n"
        "from eval.engine.table import Table\n"
        "def compute(run, options):\n    {}\n"
        "TABLE = Evaluation('Is it?', (Requirement('nothing', lambda _: ''),), lambda _: 1.0, compute)\n"
    )
    (tables / "broken.py").write_text(text.format("raise ValueError('no such luck')"), encoding="utf-8")
    (tables / "unparsed.py").write_text("def (\n", encoding="utf-8")
    (tables / "sound.py").write_text(
        text.format(
            "return TableResult([Table('T', ('a', 'b'), (('one', 2),))], figures=[Figure('drawn', 'D', b'png')])"
        ),
        encoding="utf-8",
    )
    command = [
        sys.executable,
        "-m",
        "pipeline",
        "eval",
        "all",
        "--config",
        str(DEFAULT),
        "--out",
        str(tmp_path / "out"),
    ]
    environment = {**os.environ, "PYTHONPATH": str(tmp_path / "extension")}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == 1, done.stderr
    assert "ValueError: no such luck" in done.stderr
    results = tmp_path / "out" / "shapemill-default-eval"
    assert (results / "sound.csv").read_text(encoding="utf-8") == "a,b\none,2\n"
    assert (results / "sound_drawn.png").read_bytes() == b"png"
    report = (results / "report.html").read_text(encoding="utf-8")
    assert "it failed: ValueError: no such luck" in report
    assert f"it cannot be read: {tables / 'unparsed.py'}:1: SyntaxError" in report
    assert 'id="sound"' in report
    assert all(f"<td>{name}</td>" in report for name in read_tables()[0]), "what was not made is listed"
    alone = subprocess.run(
        [*command[:4], "sound", *command[5:]], cwd=ROOT, env=environment, capture_output=True, text=True
    )
    assert alone.returncode == 0, alone.stderr
    page = (results / "sound.html").read_text(encoding="utf-8")
    assert 'id="sound"' in page
    assert "not-made" not in page
