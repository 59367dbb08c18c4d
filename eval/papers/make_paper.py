"""`make paper`: makes what the tables and figures of a paper need, and writes one report about them."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

from eval.papers.experiments import PaperStep, limit_waiting_threads, make_experiment
from eval.papers.paper import PAPERS, Scale, load_paper
from eval.papers.report import PaperReport, write_report


def list_papers() -> str:
    """Describe every paper: its citation, and how many of its tables and figures have which verdict."""
    lines = []
    for name in PAPERS:
        paper = load_paper(name)
        numbers = len({result.number for result in paper.results})
        lines.append(f"  {name:<15}{numbers} tables and figures. {paper.citation}")
    return "\n".join([*lines, "", "make paper PAPER=<name> SCALE=minutes reports each of them", ""])


def make_paper(name: str, scale: Scale, out: Path, workers: int) -> int:
    """Make the experiments of a paper at a scale in `OUT/paper-<name>-<scale>`, and its report.

    Return the number of steps that failed; what data is missing for is no failure. Raises ConfigError for an unknown
    paper.
    """
    limit_waiting_threads()
    paper, started = load_paper(name), datetime.now(UTC)
    folder = out / f"paper-{name}-{scale}"
    steps: list[PaperStep] = []
    for experiment in paper.experiments:
        print(f"{name}: {experiment.name}", flush=True)
        steps += make_experiment(experiment, scale, folder, workers)
    report = PaperReport(name, paper, scale, steps)
    page, text = write_report(report, folder, started)
    failed = [step for step in steps if step.failure]
    for step in failed:
        print(f"{step.command}: {step.failure}")
    overview = report.overview().rows
    shown = sum(str(row[3]).startswith("shown") for row in overview)
    print(f"{page}, {text.name}: {shown} of {len(overview)} tables and figures shown, {len(failed)} steps failed")
    return len(failed)
