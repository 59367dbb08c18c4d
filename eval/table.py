"""A table of figures as Markdown, CSV and LaTeX."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass

__all__ = ["Table"]

Cell = str | int | float


@dataclass(frozen=True)
class Table:
    """columns: names, in the order of the cells; rows: cells, the first of which names the row; notes: what a reader
    must know. A string cell that says nothing is empty."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    notes: Sequence[str] = ()

    def markdown(self) -> str:
        """GitHub Markdown, numbers to the right."""
        marks = ["---", *("---:" for _ in self.columns[1:])]
        lines = [self.columns, marks, *([_text(cell) for cell in row] for row in self.rows)]
        body = "\n".join("| " + " | ".join(cell.replace("|", r"\|") for cell in line) + " |" for line in lines)
        return "\n\n".join([f"**{self.title}**", body, *self.notes]) + "\n"

    def csv(self) -> str:
        """One header line and one line a row, numbers in full."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(self.columns)
        writer.writerows(self.rows)
        return text.getvalue()

    def latex(self) -> str:
        """A `tabular` with `booktabs` rules."""
        lines = [rf"\begin{{tabular}}{{l{'r' * (len(self.columns) - 1)}}}", r"\toprule"]
        lines.append(" & ".join(_escaped(name) for name in self.columns) + r" \\")
        lines.append(r"\midrule")
        lines += [" & ".join(_escaped(_text(cell)) for cell in row) + r" \\" for row in self.rows]
        lines += [r"\bottomrule", r"\end{tabular}"]
        return "\n".join(lines) + "\n"


def _text(cell: Cell) -> str:
    if isinstance(cell, float):
        return f"{cell:.1f}" if abs(cell) >= 10 else f"{cell:.3g}"
    return f"{cell:,}" if isinstance(cell, int) else cell


def _escaped(text: str) -> str:
    special = {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "°": r"$^\circ$"}
    return re.sub(r"[\\~^°&%$#_{}]", lambda found: special.get(found[0], "\\" + found[0]), text)
