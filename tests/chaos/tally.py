"""The table at the end of `make chaos`: rounds by fault, sandbox and result."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

_ENDINGS = ("injected", "missed", "late", "wrong")


@dataclass
class Tally:
    """Counts rounds by fault, sandbox, result and exit code."""

    _rounds: Counter[tuple[str, str, str, str]] = field(default_factory=Counter)

    def add(self, fault: str, sandbox: str, ending: str, code: int | None) -> None:
        """Count a round; `code` is None where a guarantee was broken."""
        self._rounds[fault, sandbox, ending, "?" if code is None else str(code)] += 1

    def count(self, fault: str = "", sandbox: str = "", ending: str = "") -> int:
        """Return the number of rounds of a fault, sandbox and result; without one, of all."""
        return sum(
            count
            for (injected, place, how, _), count in self._rounds.items()
            if fault in ("", injected) and sandbox in ("", place) and ending in ("", how)
        )

    def lines(self) -> Iterator[str]:
        """Yield the table: a row per fault with injected/all rounds by sandbox, results and exit codes."""
        faults = list(dict.fromkeys(key[0] for key in sorted(self._rounds)))
        sandboxes = list(dict.fromkeys(key[1] for key in sorted(self._rounds, key=lambda key: key[1])))
        rows = [["fault", *sandboxes, "rounds", *_ENDINGS, "codes"]]
        rows += [self._row(fault, fault, sandboxes) for fault in faults]
        rows += [self._row("all", "", sandboxes)]
        widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
        for row in rows:
            cells = [cell.rjust(width) for cell, width in zip(row[1:-1], widths[1:-1], strict=True)]
            yield "  ".join([row[0].ljust(widths[0]), *cells, row[-1]])

    def _row(self, title: str, fault: str, sandboxes: Sequence[str]) -> list[str]:
        cells = [f"{self.count(fault, sandbox, 'injected')}/{self.count(fault, sandbox)}" for sandbox in sandboxes]
        endings = [str(self.count(fault, "", ending)) for ending in _ENDINGS]
        codes: Counter[str] = Counter()
        for (injected, *_, code), count in self._rounds.items():
            codes[code] += count if fault in ("", injected) else 0
        output = ", ".join(f"{code}: {count}" for code, count in sorted(codes.items()) if count)
        return [title, *cells, str(self.count(fault)), *endings, output]
