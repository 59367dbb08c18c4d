"""The table at the end of `make chaos`: blow by arena, and how the rounds ended."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

_ENDINGS = ("struck", "missed", "late", "wrong")


@dataclass
class Tally:
    """Counts rounds by blow, arena, ending and the code of the struck run."""

    _rounds: Counter[tuple[str, str, str, str]] = field(default_factory=Counter)

    def add(self, blow: str, arena: str, ending: str, code: int | None) -> None:
        """Count a round; `code` is None for one that did not go as it must."""
        self._rounds[blow, arena, ending, "?" if code is None else str(code)] += 1

    def count(self, blow: str = "", arena: str = "", ending: str = "") -> int:
        """So many rounds of a blow, of an arena, with an ending; of all where nothing is said."""
        return sum(
            count
            for (struck, place, how, _), count in self._rounds.items()
            if blow in ("", struck) and arena in ("", place) and ending in ("", how)
        )

    def lines(self) -> Iterator[str]:
        """The table: a row a blow; in the columns of arenas rounds that struck of all, then the endings, then with
        which codes the struck runs ended."""
        blows = list(dict.fromkeys(key[0] for key in sorted(self._rounds)))
        arenas = list(dict.fromkeys(key[1] for key in sorted(self._rounds, key=lambda key: key[1])))
        rows = [["blow", *arenas, "rounds", *_ENDINGS, "codes"]]
        rows += [self._row(blow, blow, arenas) for blow in blows]
        rows += [self._row("all", "", arenas)]
        widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
        for row in rows:
            cells = [cell.rjust(width) for cell, width in zip(row[1:-1], widths[1:-1], strict=True)]
            yield "  ".join([row[0].ljust(widths[0]), *cells, row[-1]])

    def _row(self, title: str, blow: str, arenas: Sequence[str]) -> list[str]:
        cells = [f"{self.count(blow, arena, 'struck')}/{self.count(blow, arena)}" for arena in arenas]
        endings = [str(self.count(blow, "", ending)) for ending in _ENDINGS]
        codes: Counter[str] = Counter()
        for (struck, *_, code), count in self._rounds.items():
            codes[code] += count if blow in ("", struck) else 0
        said = ", ".join(f"{code}: {count}" for code, count in sorted(codes.items()) if count)
        return [title, *cells, str(self.count(blow)), *endings, said]
