"""The report of `make paper`: each table and figure of a paper by number, with what this run made of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from itertools import groupby
from pathlib import Path

from eval.engine.evaluation import TableResult
from eval.engine.report import FinishedTable, machine_facts, page_html
from eval.engine.results_cache import join_results
from eval.engine.table import Table
from eval.papers.experiments import PaperStep
from eval.papers.paper import Paper, PaperResult, ResultSource, Scale
from eval.papers.results_page import COLUMNS, result_cells, without_marks
from pipeline.paths import write_file

NOTICES: Mapping[Scale, str] = {
    "minutes": "A smoke run: it shows that every step works. Its data and models are tiny, so its own figures do not "
    "compare with the published ones; the column ours has the kept results of full runs.",
    "hours": "A short run: data and models are smaller than in full runs; the column ours has their kept results.",
    "full": "A full run: what it made compares with the column `ours`, the kept results of earlier full runs.",
}


@dataclass(frozen=True)
class PaperReport:
    """What a run of a paper came to."""

    name: str
    paper: Paper
    scale: Scale
    steps: Sequence[PaperStep]

    @property
    def notice(self) -> str:
        """How far the figures of this scale compare."""
        return f"SCALE={self.scale}. {NOTICES[self.scale]}"

    def numbers(self) -> list[tuple[str, list[PaperResult]]]:
        """Return the tables and figures in the order of the file, with their rows."""
        return [(number, list(rows)) for number, rows in groupby(self.paper.results, key=lambda row: row.number)]

    def overview(self) -> Table:
        """Return one row for each table and figure: its verdict, and whether this run shows it."""
        rows = []
        for number, results in self.numbers():
            verdict = ", ".join(dict.fromkeys(result.verdict for result in results))
            seconds = self.seconds(results)
            rows.append((number, results[0].subject, verdict, self.state(results), f"{seconds:.1f}" if seconds else ""))
        return Table("Tables and figures", ("number", "subject", "verdict", "this run", "s"), tuple(rows), is_text=True)

    def state(self, results: Sequence[PaperResult]) -> str:
        """Return whether this run shows a table or figure, or why not."""
        steps = self.steps_of(results)
        if not steps:
            return _why_not_shown(results)
        problems = list(dict.fromkeys(step.problem for step in steps if step.problem))
        own = self.result(results)
        is_shown = any((own.tables, own.charts, own.image_rows, own.figures, own.printed))
        if is_shown:
            return "; ".join(["shown in part" if problems else "shown below", *problems])
        return "not made: " + ("; ".join(problems) or "the tables of this run have nothing of it")

    def seconds(self, results: Sequence[PaperResult]) -> float:
        """Return the seconds of the tables and commands that a number is shown by, without datasets and models."""
        return sum({step.command: step.seconds for step in self.steps_of(results)}.values())

    def result(self, results: Sequence[PaperResult]) -> TableResult:
        """Return what this run shows of a table or figure."""
        sources = dict.fromkeys(source for result in results for source in result.shown)
        found = [_part_of(step.result, source) for source in sources for step in self._steps_of(source) if step.result]
        joined = join_results(found)
        printed = "\n\n".join(result.printed for result in found if result.printed)
        return TableResult(joined.tables, joined.charts, joined.image_rows, joined.figures, printed)

    def commands(self) -> Table:
        """Return what was run: every command, its seconds, and how it ended."""
        rows = [
            (step.command, f"{step.seconds:.1f}" if step.seconds else "", step.problem or "made") for step in self.steps
        ]
        title = f"Commands, {sum(step.seconds for step in self.steps):.0f} s in all"
        return Table(title, ("command", "s", "end"), tuple(rows), is_text=True)

    def steps_of(self, results: Sequence[PaperResult]) -> list[PaperStep]:
        """Return the steps that show a table or figure."""
        return [step for result in results for source in result.shown for step in self._steps_of(source)]

    def _steps_of(self, source: ResultSource) -> Iterator[PaperStep]:
        """Yield the steps with the results of a source; for a source that has no table, the steps that have none."""
        for step in self.steps:
            if step.experiment == source.experiment and step.table == source.table:
                yield step


def _why_not_shown(results: Sequence[PaperResult]) -> str:
    result = results[0]
    if result.verdict == "concept":
        return "it explains an idea"
    if result.verdict in {"not here", "missing"}:
        return f"cannot be made here: {result.remark}" if result.verdict == "not here" else f"missing: {result.remark}"
    return f"measured by `{result.command}` alone" if result.command else result.remark


def _part_of(result: TableResult, source: ResultSource) -> TableResult:
    """Return the tables, charts and pictures whose titles, or names of pictures, have one of the parts of a source."""
    if not source.parts:
        return result

    def is_meant(title: str) -> bool:
        return any(part.lower() in title.lower() for part in source.parts)

    return TableResult(
        [table for table in result.tables if is_meant(table.title)],
        [chart for chart in result.charts if is_meant(chart.title)],
        [row for row in result.image_rows if is_meant(row.title)],
        [figure for figure in result.figures if is_meant(figure.name)],
    )


def _kept(report: PaperReport, results: Sequence[PaperResult]) -> Table:
    """Return the published figures of a number next to the kept ones, and below them the commands of this run."""
    steps = {step.command: step for step in report.steps_of(results)}.values()
    notes = [f"This run: {step.command} ({step.problem or f'{step.seconds:.1f} s'})" for step in steps]
    rows = tuple(result_cells(row)[1:] for row in results)
    return Table(
        "Published, and kept", COLUMNS[1:], rows, notes or [f"This run: {report.state(results)}"], is_text=True
    )


def write_report(report: PaperReport, folder: Path, started: datetime) -> tuple[Path, Path]:
    """Write `report.html` and `report.md` and return their paths."""
    html = write_file(folder / "report.html", _html(report, folder, started).encode())
    return html, write_file(folder / "report.md", _markdown(report, started).encode())


def _html(report: PaperReport, folder: Path, started: datetime) -> str:
    sections = [FinishedTable("overview", without_marks(report.paper.citation), TableResult([report.overview()]), 0)]
    for number, results in report.numbers():
        own = report.result(results)
        kept = _kept(report, results)
        plain_rows = tuple(tuple(without_marks(str(cell)) for cell in row) for row in kept.rows)
        tables = [replace(kept, rows=plain_rows), *own.tables]
        shown = TableResult(tables, own.charts, own.image_rows, own.figures, own.printed)
        sections.append(FinishedTable(number.replace(" ", "_"), results[0].subject, shown, report.seconds(results)))
    sections.append(FinishedTable("commands", "What was run", TableResult([report.commands()]), 0))
    configs = [(path.name, path.read_text(encoding="utf-8")) for path in sorted(folder.glob("*.yaml"))]
    return page_html(report.paper.title, report.notice, sections, {}, machine_facts(started), configs)


def _markdown(report: PaperReport, started: datetime) -> str:
    lines = [f"# {report.paper.title}", "", report.notice, "", report.paper.citation, "", report.overview().markdown()]
    for number, results in report.numbers():
        own = report.result(results)
        lines += [f"## {number}: {results[0].subject}", "", _kept(report, results).markdown()]
        lines += [table.markdown() for table in own.tables]
        lines += [f"```\n{own.printed}\n```\n"] if own.printed else []
        pictures = len(own.figures) + sum(len(row.pictures) for row in own.image_rows)
        lines += [f"{pictures} pictures are in `report.html`.\n"] if pictures else []
    lines += ["## Commands", "", report.commands().markdown()]
    lines += [f"- {name}: {text}" for name, text in machine_facts(started)]
    return "\n".join(lines) + "\n"
