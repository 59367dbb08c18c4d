"""`eval/RESULTS.md` has a row for each table and figure of the five papers, and counts them right."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

import pytest

PAGE = (Path(__file__).resolve().parents[2] / "eval/RESULTS.md").read_text(encoding="utf-8")
NUMBERS = {
    "Strings": (2, 10),
    "ShapeAssembly": (7, 15),
    "Substructures": (1, 15),
    "Symmetry": (0, 10),
    "GeoCode": (3, 17),
}
"""Tables and figures of each paper."""
VERDICTS = ("beaten", "level", "behind", "reproduced", "partly", "not here", "missing", "concept")


def rows(paper: str) -> list[list[str]]:
    section = PAGE.split(f"\n## {paper}\n")[1].split("\n## ")[0]
    lines = re.findall(r"^\|(.*)\|$", section, re.MULTILINE)[2:]
    return [[cell.strip() for cell in line.split("|")] for line in lines]


@pytest.mark.parametrize("paper", NUMBERS)
def test_every_table_and_figure_has_a_row(paper: str) -> None:
    tables, figures = NUMBERS[paper]
    expected = [f"Table {n}" for n in range(1, tables + 1)] + [f"Figure {n}" for n in range(1, figures + 1)]
    assert sorted({row[0] for row in rows(paper)} - {"§6"}) == sorted(expected)


@pytest.mark.parametrize("paper", NUMBERS)
def test_verdicts_are_counted(paper: str) -> None:
    verdicts = [next(verdict for verdict in VERDICTS if row[4].startswith(verdict)) for row in rows(paper)]
    counts = Counter(verdicts)
    stated = re.search(rf"^\| {paper.lower()} \|(.*)\|$", PAGE, re.MULTILINE)
    assert stated
    assert [int(cell) for cell in stated[1].split("|")] == [counts[verdict] for verdict in VERDICTS]


@pytest.mark.parametrize("paper", NUMBERS)
def test_rows_with_published_or_own_figures_name_a_command_or_the_tests(paper: str) -> None:
    measured = [row for row in rows(paper) if row[4].startswith(("beaten", "level", "behind"))]
    assert all(row[5] for row in measured)
    assert all(len(row) == 6 for row in rows(paper))
