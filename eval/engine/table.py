"""A table of results and published reference rows, as Markdown, CSV and LaTeX."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

Cell = str | int | float


@dataclass(frozen=True)
class ReferenceRow:
    """A published row."""

    name: str
    source: str
    """Paper and table."""
    values: Mapping[str, Cell]
    """By column."""


@dataclass(frozen=True)
class Table:
    """Rows of cells under named columns. Raises ValueError for a reference value in an unknown column."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    """The first cell of a row names it; a cell without a value is an empty text."""
    notes: Sequence[str] = ()
    """How to read the table; printed below it."""
    reference_rows: Sequence[ReferenceRow] = ()
    """Printed below ours."""
    is_text: bool = False
    """Whether cells are sentences, which are aligned to the left and wrapped."""

    def __post_init__(self) -> None:
        for row in self.reference_rows:
            unknown = set(row.values) - set(self.columns[1:])
            if unknown:
                raise ValueError(f"{row.source} has {', '.join(sorted(unknown))}, which is no column of {self.title}")

    def references_by_source(self) -> dict[str, list[tuple[Cell, ...]]]:
        """Return the reference rows by source, their cells in the order of the columns."""
        by_source: dict[str, list[tuple[Cell, ...]]] = {}
        for row in self.reference_rows:
            cells = (row.name, *(row.values.get(column, "") for column in self.columns[1:]))
            by_source.setdefault(row.source, []).append(cells)
        return by_source

    def _all_rows(self) -> Iterator[tuple[Cell, ...]]:
        """Yield our rows, then the reference rows, named with their source."""
        yield from self.rows
        for source, rows in self.references_by_source().items():
            yield from ((f"{name} ({source})", *cells) for name, *cells in rows)

    def markdown(self) -> str:
        """Return GitHub Markdown, numbers aligned to the right."""
        marks = ["---", *("---" if self.is_text else "---:" for _ in self.columns[1:])]
        rows = [[cell_text(cell) for cell in row] for row in self._all_rows()]
        lines = [self.columns, marks, *rows]
        body = "\n".join("| " + " | ".join(cell.replace("|", r"\|") for cell in line) + " |" for line in lines)
        return "\n\n".join([f"**{self.title}**", body, *self.notes]) + "\n"

    def csv(self) -> str:
        """Return a header line and one line a row, numbers in full."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(self.columns)
        writer.writerows(self._all_rows())
        return text.getvalue()

    def latex(self) -> str:
        """Return a `tabular` with `booktabs` rules."""
        lines = [rf"\begin{{tabular}}{{l{'r' * (len(self.columns) - 1)}}}", r"\toprule"]
        lines.append(" & ".join(_escaped(name) for name in self.columns) + r" \\")
        lines.append(r"\midrule")
        rows = [" & ".join(_escaped(cell_text(cell)) for cell in row) + r" \\" for row in self._all_rows()]
        lines += rows[: len(self.rows)]
        lines += [r"\midrule", *rows[len(self.rows) :]] if self.reference_rows else []
        lines += [r"\bottomrule", r"\end{tabular}"]
        return "\n".join(lines) + "\n"


def cell_text(cell: Cell) -> str:
    """Return a cell for people: three significant digits, thousands with commas."""
    if isinstance(cell, float):
        return f"{cell:,.0f}" if abs(cell) >= 1000 else f"{cell:.1f}" if abs(cell) >= 10 else f"{cell:.3g}"
    return f"{cell:,}" if isinstance(cell, int) else cell


def _escaped(text: str) -> str:
    special = {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "°": r"$^\circ$"}
    return re.sub(r"[\\~^°&%$#_{}]", lambda match: special.get(match[0], "\\" + match[0]), text)
