"""How many shapes and parts share a program structure (shapeassembly §7.1.4, figure 10)."""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import accumulate

from eval.engine.evaluation import Chart
from eval.engine.table import Cell, Table
from stages.shapeassembly.analysis.structure import block_signatures, signature
from stages.shapeassembly.syntax.program import AssemblyProgram

MAX_CHART_POINTS = 200
SHARES = (50, 90)
"""Percentages of the shapes or parts that the most frequent structures capture."""

TITLE = "Figure 10, clusters of one structure"


def captured_shares(signatures: Sequence[str]) -> list[float]:
    """Return the percentage of items that the 1, 2, 3, ... most frequent signatures capture together."""
    counts = sorted(Counter(signatures).values(), reverse=True)
    return [100 * captured / len(signatures) for captured in accumulate(counts)]


def clusters(programs: Mapping[str, Sequence[AssemblyProgram]]) -> tuple[Table, list[Chart]]:
    """Return figure 10 of the programs of each category: its table, and a chart of shapes and of parts.

    A shape is a whole program, a part one of its assemblies. Both are equal up to continuous parameters.
    """
    of_shapes = {name: captured_shares([signature(program) for program in own]) for name, own in programs.items()}
    of_parts = {
        name: captured_shares([digest for program in own for digest in block_signatures(program)])
        for name, own in programs.items()
    }
    rows: list[tuple[Cell, ...]] = []
    for name, own in programs.items():
        parts = sum(len(program.blocks) for program in own)
        for kind, count, shares in (("shapes", len(own), of_shapes[name]), ("parts", parts, of_parts[name])):
            needed = [1 + bisect_left(shares, share) for share in SHARES]
            rows.append((f"{name}, {kind}", count, len(shares), shares[0], *needed))
    columns = ("training", "count", "structures", "largest %", *(f"for {share} %" for share in SHARES))
    notes = (
        "Clusters of training programs, and of their assemblies, that are equal up to continuous parameters. Largest: "
        "share of the most frequent structure. For 50 %: the fewest structures that have half of the shapes or parts.",
    )
    charts = [
        Chart(f"{TITLE}: {kind}", "structures", f"% of {kind}", {name: _points(own) for name, own in by.items()})
        for kind, by in (("shapes", of_shapes), ("parts", of_parts))
    ]
    return Table(TITLE, columns, tuple(rows), notes), charts


def _points(shares: Sequence[float]) -> list[tuple[float, float]]:
    """Return at most about MAX_CHART_POINTS points of a line, with its ends."""
    step = -(-len(shares) // MAX_CHART_POINTS)
    numbers = sorted({*range(0, len(shares), step), len(shares) - 1})
    return [(0.0, 0.0), *((number + 1.0, shares[number]) for number in numbers)]
