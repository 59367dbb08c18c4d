"""Figures about a corpus: cycle rank of its shapes; of its strings length, cycles, depth of branches, and tokens."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from stages.strings.tokens import number_value, split_tokens


@dataclass(frozen=True)
class StringFigures:
    """One string: its characters, tokens, nodes, cycle edges, and parentheses open at once at most."""

    characters: int
    tokens: int
    nodes: int
    cycles: int
    branch_depth: int


@dataclass
class StringStatistics:
    """What a corpus file holds, counted string by string; memory stays flat. duplicates, elsewhere: strings left out
    because the file, or that of another split, has them already."""

    shapes: int = 0
    graphs: int = 0
    strings: int = 0
    duplicates: int = 0
    elsewhere: int = 0
    seen: Counter[str] = field(default_factory=Counter)
    figures: dict[str, Counter[int]] = field(default_factory=dict)

    def add_shape(self, cycle_rank: int) -> None:
        """Count one shape: contacts of its graph that close cycles, told by its strings or not."""
        self.shapes += 1
        self.figures.setdefault("cycle_rank", Counter())[cycle_rank] += 1

    def add(self, string: str) -> None:
        """Count one string."""
        self.strings += 1
        for name, value in vars(measure_string(string, self.seen)).items():
            self.figures.setdefault(name, Counter())[value] += 1

    def describe(self) -> dict[str, Any]:
        """As JSON: counts, and for each figure its least, median, mean and greatest value, and strings by value (of the
        cycle rank: shapes by value)."""
        described: dict[str, Any] = {
            "shapes": self.shapes,
            "graphs": self.graphs,
            "strings": self.strings,
            "duplicates_dropped": self.duplicates,
            "elsewhere_dropped": self.elsewhere,
            "tokens_seen": dict(sorted(self.seen.items())),
        }
        for name, counts in self.figures.items():
            described[name] = {
                "least": min(counts),
                "median": _median(counts),
                "mean": round(sum(value * count for value, count in counts.items()) / counts.total(), 3),
                "most": max(counts),
                "histogram": {str(value): counts[value] for value in sorted(counts)},
            }
        return described


def summarize(splits: Iterable[StringStatistics]) -> dict[str, dict[str, int]]:
    """Median and greatest value of each figure over several files together, as JSON."""
    joined: dict[str, Counter[int]] = {}
    for each in splits:
        for name, counts in each.figures.items():
            joined.setdefault(name, Counter()).update(counts)
    return {name: {"median": _median(counts), "most": max(counts)} for name, counts in joined.items()}


def _median(counts: Mapping[int, int]) -> int:
    """The least value that at least half do not exceed."""
    half, passed = sum(counts.values()) / 2, 0
    for value in sorted(counts):
        passed += counts[value]
        if passed >= half:
            return value
    raise ValueError("nothing was counted")


def measure_string(string: str, seen: Counter[str] | None = None) -> StringFigures:
    """The figures of a well-formed string; its tokens are counted into `seen` as well."""
    texts = split_tokens(string)
    counts = Counter(texts)
    if seen is not None:
        seen.update(counts)
    numbers = sum(count for text, count in counts.items() if number_value(text) is not None)
    branches = counts["("]
    depth = deepest = 0
    if branches:
        for text in texts:
            if text == "(":
                depth += 1
                deepest = max(deepest, depth)
            elif text == ")":
                depth -= 1
    return StringFigures(len(string), len(texts), len(texts) - numbers - 2 * branches, numbers // 2, deepest)
