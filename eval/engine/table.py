"""A table of figures, with published ones beside ours, as Markdown, CSV and LaTeX."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

Cell = str | int | float


@dataclass(frozen=True)
class ReferenceRow:
    """A row that others have published. source: paper and table; figures: by column."""

    name: str
    source: str
    figures: Mapping[str, Cell]


@dataclass(frozen=True)
class Table:
    """columns: names, in the order of the cells; rows: cells, the first of which names the row; notes: what a reader
    must know; published: rows to stand below ours. A string cell that says nothing is empty.

    Raises ValueError for published figures in a column that is not there.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    notes: Sequence[str] = ()
    published: Sequence[ReferenceRow] = ()

    def __post_init__(self) -> None:
        for each in self.published:
            unknown = set(each.figures) - set(self.columns[1:])
            if unknown:
                raise ValueError(f"{each.source} has {', '.join(sorted(unknown))}, which is no column of {self.title}")

    def published_by_source(self) -> dict[str, list[tuple[Cell, ...]]]:
        """The published rows, cells in the order of the columns, by their sources."""
        found: dict[str, list[tuple[Cell, ...]]] = {}
        for each in self.published:
            cells = (each.name, *(each.figures.get(column, "") for column in self.columns[1:]))
            found.setdefault(each.source, []).append(cells)
        return found

    def _all_rows(self) -> Iterator[tuple[Cell, ...]]:
        """Our rows, then the published ones, named with their source."""
        yield from self.rows
        for source, rows in self.published_by_source().items():
            yield from ((f"{name} ({source})", *figures) for name, *figures in rows)

    def markdown(self) -> str:
        """GitHub Markdown, numbers to the right."""
        marks = ["---", *("---:" for _ in self.columns[1:])]
        rows = [[cell_text(cell) for cell in row] for row in self._all_rows()]
        lines = [self.columns, marks, *rows]
        body = "\n".join("| " + " | ".join(cell.replace("|", r"\|") for cell in line) + " |" for line in lines)
        return "\n\n".join([f"**{self.title}**", body, *self.notes]) + "\n"

    def csv(self) -> str:
        """One header line and one line a row, numbers in full."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(self.columns)
        writer.writerows(self._all_rows())
        return text.getvalue()

    def latex(self) -> str:
        """A `tabular` with `booktabs` rules."""
        lines = [rf"\begin{{tabular}}{{l{'r' * (len(self.columns) - 1)}}}", r"\toprule"]
        lines.append(" & ".join(_escaped(name) for name in self.columns) + r" \\")
        lines.append(r"\midrule")
        rows = [" & ".join(_escaped(cell_text(cell)) for cell in row) + r" \\" for row in self._all_rows()]
        lines += rows[: len(self.rows)]
        lines += [r"\midrule", *rows[len(self.rows) :]] if self.published else []
        lines += [r"\bottomrule", r"\end{tabular}"]
        return "\n".join(lines) + "\n"


def cell_text(cell: Cell) -> str:
    """A cell as people read it: three digits that matter, thousands with commas."""
    if isinstance(cell, float):
        return f"{cell:,.0f}" if abs(cell) >= 1000 else f"{cell:.1f}" if abs(cell) >= 10 else f"{cell:.3g}"
    return f"{cell:,}" if isinstance(cell, int) else cell


def _escaped(text: str) -> str:
    special = {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "°": r"$^\circ$"}
    return re.sub(r"[\\~^°&%$#_{}]", lambda found: special.get(found[0], "\\" + found[0]), text)
