"""Tables are found, say what they need, and carry published rows."""

from __future__ import annotations

import csv
import io
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from eval.__main__ import main
from eval.engine.dataset_run import DatasetRun, load_dataset_run
from eval.engine.evaluation import Evaluation
from eval.engine.registry import find_tables
from eval.engine.requirements import FINISHED_DATASET, KITS, STRING_VAE
from eval.engine.table import ReferenceRow, Table

ROOT = Path(__file__).resolve().parents[2]
DEFAULT, CHAIRS = ROOT / "configs" / "default.yaml", ROOT / "configs" / "chairs.yaml"


def test_every_module_of_the_folder_is_a_table_with_a_question_and_needs() -> None:
    found = find_tables()
    assert list(found) == sorted(each.stem for each in (ROOT / "eval" / "tables").glob("[!_]*.py"))
    for each in found.values():
        assert isinstance(each, Evaluation)
        assert each.question.endswith("?")
        assert each.needs


def test_a_module_without_a_table_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "stray").mkdir()
    (tmp_path / "stray" / "__init__.py").touch()
    (tmp_path / "stray" / "wrong.py").write_text("TABLE = 3\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(TypeError, match=r"stray/wrong\.py must hold TABLE"):
        find_tables("stray")
    for name in ("stray", "stray.wrong"):
        sys.modules.pop(name, None)


def finished(out: Path, config: Path) -> DatasetRun:
    """The subject of a dataset of which only the manifest is there."""
    subject = load_dataset_run(config, out)
    subject.folder.mkdir(parents=True)
    (subject.folder / "manifest.json").write_text(json.dumps({"samples": 1200}))
    return subject


def test_what_is_missing_is_named_with_what_makes_it(tmp_path: Path) -> None:
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


def test_without_a_table_all_are_listed_with_what_they_lack(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["--config", str(DEFAULT), "--out", str(tmp_path)]
    assert main(asked) == 0
    before = capsys.readouterr().out
    for name, each in find_tables().items():
        assert f"  {name} " in before
        assert each.question in before
    assert before.count("missing:") == len(find_tables())
    finished(tmp_path, DEFAULT)
    assert main([*asked, "--", ""]) == 0
    after = capsys.readouterr().out
    assert "1,200 shapes" in after
    assert after.count("can be made, takes about") >= 2


def test_a_table_that_is_not_there_is_told_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["physicl"]) == 2
    assert "did you mean physical?" in capsys.readouterr().err


def test_a_table_about_datasets_takes_no_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["near_twins", str(tmp_path / "a.glb")]) == 2
    assert "not about files" in capsys.readouterr().err


def test_published_rows_stand_below_ours_with_their_source_in_every_format() -> None:
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
    assert list(table.published_by_source()) == ["strings Table 2", "shapeassembly Table 5"]


def test_published_figures_must_have_a_column() -> None:
    with pytest.raises(ValueError, match="strings Table 2 has depth, which is no column of T"):
        Table("T", ("kit", "size"), (), (), (ReferenceRow("a", "strings Table 2", {"depth": 1}),))


def test_a_table_that_fails_is_told_and_takes_no_other_with_it(tmp_path: Path) -> None:
    """Tables of a house beside the project's, one of which fails, and the project's own, which lack their dataset."""
    house = tmp_path / "house" / "eval" / "tables"
    house.mkdir(parents=True)
    text = (
        "from eval.engine.evaluation import Answer, Evaluation, Need, Sheet\nfrom eval.engine.table import Table\n"
        "def answer(subject, asked):\n    {}\n"
        "TABLE = Evaluation('Is it?', (Need('nothing', lambda _: ''),), lambda _: 1.0, answer)\n"
    )
    (house / "broken.py").write_text(text.format("raise ValueError('no such luck')"))
    (house / "sound.py").write_text(
        text.format("return Answer([Table('T', ('a', 'b'), (('one', 2),))], sheets=[Sheet('drawn', 'D', b'png')])")
    )
    command = [sys.executable, "-m", "eval", "all", "--config", str(DEFAULT), "--out", str(tmp_path / "out")]
    environment = {**os.environ, "PYTHONPATH": str(tmp_path / "house")}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == 1, done.stderr
    assert "ValueError: no such luck" in done.stderr
    results = tmp_path / "out" / "shapemill-default-eval"
    assert (results / "sound.csv").read_text() == "a,b\none,2\n"
    assert (results / "sound_drawn.png").read_bytes() == b"png"
    report = (results / "report.html").read_text()
    assert "it failed: ValueError: no such luck" in report
    assert 'id="sound"' in report
    assert all(f"<td>{name}</td>" in report for name in find_tables()), "what was not made is listed"
    alone = subprocess.run(
        [*command[:3], "sound", *command[4:]], cwd=ROOT, env=environment, capture_output=True, text=True
    )
    assert alone.returncode == 0, alone.stderr
    page = (results / "sound.html").read_text()
    assert 'id="sound"' in page
    assert "not-made" not in page
