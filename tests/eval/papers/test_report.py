"""Experiments are made once, failures and missing data are stated, and the report has every number."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import pytest

from eval.papers.experiments import make_experiment
from eval.papers.paper import Experiment, Paper, PaperResult, ResultSource, ScaledExperiment
from eval.papers.report import PaperReport, write_report
from tests.command import shapemill

MINUTES = {"minutes": ScaledExperiment()}
COUNTING = "python -m timeit -n 1 -r 1 -s \"path = '{out}/runs'\" \"open(path, 'a').write('x')\""


def experiment(name: str, command: str, **fields: object) -> Experiment:
    return Experiment.model_validate({"name": name, "command": command, "scales": MINUTES, **fields})


def test_a_command_runs_once_and_again_when_it_changes(tmp_path: Path) -> None:
    for _ in range(2):
        (step,) = make_experiment(experiment("count", COUNTING), "minutes", tmp_path, 1)
        assert step.result
        assert "loop" in step.result.printed
        assert step.seconds > 0
        assert (tmp_path / "runs").read_text(encoding="utf-8") == "x"
    make_experiment(experiment("count", COUNTING + " pass"), "minutes", tmp_path, 1)
    assert (tmp_path / "runs").read_text(encoding="utf-8") == "xx"


def test_failures_and_missing_data_are_stated_and_nothing_is_kept(tmp_path: Path) -> None:
    (failed,) = make_experiment(experiment("fails", "python -m timeit --nonsense"), "minutes", tmp_path, 1)
    assert failed.failure
    assert "it failed" in failed.problem
    (missing,) = make_experiment(experiment("absent", COUNTING, needs=(tmp_path / "none",)), "minutes", tmp_path, 1)
    assert not missing.failure
    assert f"needs {tmp_path / 'none'}" in missing.missing
    (small,) = make_experiment(experiment("small", COUNTING), "hours", tmp_path, 1)
    assert small.missing == "not part of SCALE=hours; SCALE=minutes"
    assert not list(tmp_path.rglob("*"))


def test_report_has_every_number_with_its_state(tmp_path: Path) -> None:
    experiments = (experiment("count", COUNTING), experiment("absent", COUNTING, needs=(tmp_path / "none",)))

    def row(number: str, verdict: str, *names: str, **fields: object) -> PaperResult:
        shown = tuple(ResultSource(experiment=name) for name in names)
        return PaperResult.model_validate(
            {"number": number, "subject": f"<{number}>", "verdict": verdict, "shown": shown, **fields}
        )

    paper = Paper(
        title="A paper",
        citation="Doe: *A paper*, 2020.",
        introduction="",
        experiments=experiments,
        results=(
            row("Table 1", "beaten", "count", published="1 | 2", ours="3"),
            row("Table 1", "behind", "count", "absent", published="4", ours="3", remark="by 1"),
            row("Figure 1", "reproduced", "absent"),
            row("Figure 2", "not here", remark="people"),
            row("Figure 3", "reproduced", command="pytest tests"),
            PaperResult(
                number="Figure 4",
                subject="a part that this run does not have",
                verdict="reproduced",
                shown=(ResultSource(experiment="count", parts=("no such title",)),),
            ),
        ),
    )
    steps = [step for item in experiments for step in make_experiment(item, "minutes", tmp_path, 1)]
    report = PaperReport("a", paper, "minutes", steps)
    states = {str(cells[0]): str(cells[3]) for cells in report.overview().rows}
    assert list(states) == ["Table 1", "Figure 1", "Figure 2", "Figure 3", "Figure 4"]
    assert states["Table 1"].startswith("shown in part; needs")
    assert states["Figure 1"].startswith("not made: needs")
    assert states["Figure 2"] == "cannot be made here: people"
    assert states["Figure 3"] == "measured by `pytest tests` alone"
    assert states["Figure 4"] == "not made: the tables of this run have nothing of it"
    html, markdown = (path.read_text(encoding="utf-8") for path in write_report(report, tmp_path, datetime.now(UTC)))
    for text in (html, markdown):
        assert "smoke run" in text
        assert all(number in text for number in states)
        assert "behind: by 1" in text
        assert "loop" in text
    assert "<Table 1>" not in html, "texts are escaped"
    assert r"1 \| 2" in markdown


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("string",), "PAPER=string: did you mean strings? PAPER is one of strings, shapeassembly"),
        (("strings", "--scale", "minute"), "SCALE=minute: did you mean minutes? SCALE is one of minutes, hours, full"),
    ],
)
def test_unknown_paper_and_scale_name_the_choices(arguments: tuple[str, ...], message: str) -> None:
    code, printed = shapemill("paper", *arguments)
    assert code == 2
    assert message in printed


def test_papers_are_listed() -> None:
    code, printed = shapemill("paper", "--", "")
    assert code == 0
    assert "geocode        20 tables and figures" in printed
