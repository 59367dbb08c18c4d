"""The papers' files have every table and figure, name what exists, and are what `eval/RESULTS.md` says."""

from __future__ import annotations

import re
import shlex
from html import unescape
from importlib.util import find_spec
from pathlib import Path

import pytest
import typer

from eval.engine.evaluate import find_table, table_options
from eval.papers.experiments import make_experiment, planned_steps, write_scaled_config
from eval.papers.paper import PAPERS, SCALES, Experiment, Paper, ScaledExperiment, load_paper
from eval.papers.results_page import RESULTS_PAGE, result_cells, results_html, results_page, without_marks
from pipeline.cli import command_line
from pipeline.config import load_config
from pipeline.registry import find_stages

ROOT = Path(__file__).resolve().parents[3]
SHARED = ROOT.parent / "shared"
NUMBERS = {
    "strings": (2, 10),
    "shapeassembly": (7, 15),
    "substructures": (1, 15),
    "symmetry": (0, 10),
    "geocode": (3, 17),
}
"""Tables and figures of each paper, as its own text numbers them."""


@pytest.fixture(autouse=True)
def _in_root(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)


@pytest.fixture(params=PAPERS)
def paper(request: pytest.FixtureRequest) -> Paper:
    return load_paper(request.param)


def kept_commands(paper: Paper) -> list[list[str]]:
    return [shlex.split(command) for command in dict.fromkeys(row.command for row in paper.results) if command]


@pytest.mark.parametrize("name", PAPERS)
def test_every_table_and_figure_has_a_row(name: str) -> None:
    tables, figures = NUMBERS[name]
    expected = [f"Table {n}" for n in range(1, tables + 1)] + [f"Figure {n}" for n in range(1, figures + 1)]
    found = dict.fromkeys(row.number for row in load_paper(name).results)
    assert sorted(set(found) - {"§6"}) == sorted(expected)


@pytest.mark.skipif(not (SHARED / "papers").is_dir(), reason="the papers are not here")
def test_captions_of_the_papers_end_at_these_numbers() -> None:
    for name, path in zip(PAPERS, sorted((SHARED / "papers").glob("0*.txt")), strict=True):
        text = path.read_text(encoding="utf-8")
        tables, figures = (
            max(map(int, re.findall(rf"\b{word}\s*(\d+)\s*[:.]", text)), default=0)
            for word in ("Table", r"(?:Fig\.|Figure)")
        )
        assert (tables, figures) == NUMBERS[name]


def test_a_row_without_a_result_says_why(paper: Paper) -> None:
    for row in paper.results:
        if row.verdict in {"partly", "not here", "missing", "behind"}:
            assert row.remark, row.number
        if row.verdict in {"beaten", "level", "behind"}:
            assert row.published, row.number
            assert row.ours, row.number
            assert row.command, row.number


def test_page_is_written_from_the_files() -> None:
    assert RESULTS_PAGE.read_text(encoding="utf-8") == results_page(), "run `make results`"


def test_html_page_has_every_row_without_marks() -> None:
    page = unescape(results_html())
    for name in PAPERS:
        for row in load_paper(name).results:
            assert all(f"<td>{without_marks(cell)}</td>" in page for cell in result_cells(row)), row.number
    assert "`" not in page.partition("<body>")[2]


def test_kept_commands_exist(paper: Paper) -> None:
    targets = set(re.findall(r"^([a-z0-9_-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    for first, *rest in kept_commands(paper):
        if first == "make":
            values = dict(argument.split("=", 1) for argument in rest[1:])
            assert rest[0] in targets
            assert Path(values.get("CONFIG", "configs/default.yaml")).is_file()
            if "TABLE" in values:
                find_table(values["TABLE"])
        elif first == "shapemill":
            check_shapemill(rest)
        elif first == "python":
            assert find_spec(rest[1]), rest
        else:
            assert first == "pytest"
            assert Path(rest[0]).exists(), rest


def check_shapemill(arguments: list[str]) -> None:
    """Check that commands, options, tables and configs exist, without running anything."""
    command = typer.main.get_command(command_line("stages", "eval"))
    while hasattr(command, "commands"):
        command = command.commands[arguments[0]]
        arguments = arguments[1:]
    context = command.make_context("shapemill", list(arguments))
    if command.name == "eval":
        table = find_table(context.params["table"])
        keys = [setting.partition("=")[0] for setting in context.params["settings"] or ()]
        assert set(keys) <= set(table.options.model_fields)


@pytest.mark.parametrize("scale", SCALES)
def test_every_experiment_can_be_planned_at_every_scale(paper: Paper, scale: str, tmp_path: Path) -> None:
    stages = find_stages()
    sections = {name: stage.config for name, stage in stages.items()}
    for experiment in paper.experiments:
        scaled = experiment.scales.get(scale, ScaledExperiment())  # type: ignore[call-overload]
        for step in planned_steps(experiment, scale, tmp_path, 2):  # type: ignore[arg-type]
            first, *rest = shlex.split(step.command)
            if first == "shapemill" and rest[0] != "eval":
                check_shapemill(rest)
            assert first == "shapemill" or find_spec(rest[1])
            if step.table:
                table = find_table(step.table)
                table_options(step.table, table.options, scaled.options.get(step.table, {}))
                assert not experiment.files or table.compute_from_files
        if experiment.config and all(path.exists() for path in experiment.needs):
            config = load_config(write_scaled_config(experiment, experiment.config, scale, tmp_path), sections)
            for stage in stages.values():
                stage.check(config)


def test_a_table_about_files_is_made_and_kept(tmp_path: Path) -> None:
    files = (Path("datasets/exemplars/rows/dresser.glb"),)
    experiment = Experiment(name="files", files=files, tables=("physical",), scales={"minutes": ScaledExperiment()})
    (step,) = make_experiment(experiment, "minutes", tmp_path, 1)
    assert not step.problem
    assert step.result is not None
    assert step.result.tables
    (kept,) = make_experiment(experiment, "minutes", tmp_path, 1)
    assert kept.seconds == step.seconds
