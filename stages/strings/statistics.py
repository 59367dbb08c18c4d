"""Statistics of a corpus: cycle rank of its shapes; length, cycles, branch depth and tokens of its strings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from stages.strings.tokens import number_value, split_tokens


@dataclass(frozen=True)
class StringFigures:
    """Measures of one string."""

    characters: int
    tokens: int
    nodes: int
    cycles: int
    branch_depth: int
    """Most branches open at once."""


@dataclass
class StringStatistics:
    """Counts of a corpus file, string by string, in constant memory."""

    shapes: int = 0
    graphs: int = 0
    strings: int = 0
    duplicates: int = 0
    """Strings left out as duplicates in the file."""
    in_other_splits: int = 0
    """Strings left out because another split has them."""
    seen: Counter[str] = field(default_factory=Counter)
    """Tokens."""
    figures: dict[str, Counter[int]] = field(default_factory=dict)
    """Values of each measure."""

    def add_shape(self, cycle_rank: int) -> None:
        """Count one shape by the cycle rank of its graph, whatever its strings contain."""
        self.shapes += 1
        self.figures.setdefault("cycle_rank", Counter())[cycle_rank] += 1

    def add(self, string: str) -> None:
        """Count one string."""
        self.strings += 1
        for name, value in vars(measure_string(string, self.seen)).items():
            self.figures.setdefault(name, Counter())[value] += 1

    def describe(self) -> dict[str, Any]:
        """Return counts as JSON, and of each measure least, median, mean, greatest and a histogram."""
        described: dict[str, Any] = {
            "shapes": self.shapes,
            "graphs": self.graphs,
            "strings": self.strings,
            "duplicates_dropped": self.duplicates,
            "in_other_splits_dropped": self.in_other_splits,
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
    """Return median and greatest value of each measure over several files, as JSON."""
    joined: dict[str, Counter[int]] = {}
    for statistics in splits:
        for name, counts in statistics.figures.items():
            joined.setdefault(name, Counter()).update(counts)
    return {name: {"median": _median(counts), "most": max(counts)} for name, counts in joined.items()}


def _median(counts: Mapping[int, int]) -> int:
    """Return the least value that at least half do not exceed."""
    half, cumulative = sum(counts.values()) / 2, 0
    for value in sorted(counts):
        cumulative += counts[value]
        if cumulative >= half:
            return value
    raise ValueError("nothing was counted")


def measure_string(string: str, seen: Counter[str] | None = None) -> StringFigures:
    """Measure a well-formed string, and count its tokens in `seen`."""
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
