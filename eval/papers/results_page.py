"""Every table and figure of the five papers, published figures next to ours: `eval/RESULTS.md`, and as HTML."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from eval.engine.evaluation import TableResult
from eval.engine.report import FinishedTable, page_html
from eval.engine.table import Cell, Table
from eval.papers.paper import PAPERS, VERDICTS, Paper, PaperResult, load_paper

RESULTS_PAGE = Path(__file__).parents[1] / "RESULTS.md"
HTML_PAGE = RESULTS_PAGE.with_suffix(".html")
"""The same for a browser; it is not kept in the repository."""

INTRODUCTION = """\
# Results: the five papers, table by table

Every table and figure of the five papers, with the published figures and ours. `make results` writes this page from
[`eval/papers`](papers); `make paper PAPER=strings` makes what a paper's rows need and reports each number:
[`eval/README.md`](README.md#a-paper). Verdicts:
"""
METHOD = """\
The figures are kept by hand, from runs between 2026-11-22 and 2026-11-27; they were not measured again for this page.
Machine: 2 cores (x86_64), shared with other work, so times are CPU seconds. A row has one seed, without an interval,
unless it says otherwise. A row names its commit where that is known. Its command is today's.
"""


def results_page() -> str:
    """Return the page."""
    papers = {name: load_paper(name) for name in PAPERS}
    verdicts: list[tuple[Cell, ...]] = [(f"**{verdict}**", meaning) for verdict, meaning in VERDICTS.items()]
    counts = _rows(("paper", *VERDICTS), _counts(papers), is_text=False)
    lines = [INTRODUCTION, _rows(("verdict", "meaning"), verdicts), "", counts, "", METHOD]
    for name, paper in papers.items():
        lines += [f"## {paper.title}", "", f"{paper.citation} {paper.introduction}", ""]
        lines += [_rows(COLUMNS, [result_cells(result, with_code=True) for result in paper.results]), ""]
        lines += [paper.notes, ""] if paper.notes else []
        lines += [f"`make paper PAPER={name} SCALE=minutes`: {paper.smoke_run}", ""] if paper.smoke_run else []
    return "\n".join(lines).rstrip() + "\n"


COLUMNS = ("number", "subject", "published", "ours", "verdict", "command")


def result_cells(result: PaperResult, *, with_code: bool = False) -> tuple[str, ...]:
    """Return the cells of a row, under COLUMNS. With `with_code` the command is marked as code."""
    verdict = result.verdict + (f": {result.remark}" if result.remark else "")
    measured = ", ".join(filter(None, (result.commit, f"{result.measured:%Y-%m-%d}" if result.measured else "")))
    ours = result.ours + (f" ({measured})" if measured else "")
    command = f"`{result.command}`" if with_code and result.command else result.command
    return result.number, result.subject, result.published, ours, verdict, command


def results_html() -> str:
    """Return the page as HTML."""
    papers = {name: load_paper(name) for name in PAPERS}
    verdicts = Table("Verdicts", ("verdict", "meaning"), tuple(VERDICTS.items()), is_text=True)
    counts = Table("Numbers", ("paper", *VERDICTS), tuple(_counts(papers)))
    sections = [FinishedTable("overview", "What was published, and what we get", TableResult([counts, verdicts]), 0)]
    for name, paper in papers.items():
        rows = tuple(tuple(without_marks(cell) for cell in result_cells(result)) for result in paper.results)
        notes = [without_marks(text) for text in (paper.introduction, paper.notes) if text]
        table = Table("Tables and figures", COLUMNS, rows, notes, is_text=True)
        sections.append(FinishedTable(name, without_marks(paper.citation), TableResult([table]), 0))
    facts = [("Figures", without_marks(METHOD).replace("\n", " "))]
    return page_html(
        "Results: the five papers", "Table by table, published figures next to ours", sections, {}, facts, ()
    )


def without_marks(text: str) -> str:
    """Return a text without Markdown's marks of code and emphasis."""
    return text.replace("`", "").replace("*", "")


def _counts(papers: Mapping[str, Paper]) -> list[tuple[Cell, ...]]:
    counts = {name: Counter(result.verdict for result in paper.results) for name, paper in papers.items()}
    rows: list[tuple[Cell, ...]] = [(name, *(count[verdict] for verdict in VERDICTS)) for name, count in counts.items()]
    rows.append(("all", *(sum(count[verdict] for count in counts.values()) for verdict in VERDICTS)))
    return rows


def _rows(columns: tuple[str, ...], rows: list[tuple[Cell, ...]] | list[tuple[str, ...]], is_text: bool = True) -> str:
    """Return a Markdown table without its title."""
    return Table("", columns, tuple(rows), is_text=is_text).markdown().partition("\n\n")[2].rstrip()
