"""Length and cycles of strings, by the contacts that they contain (strings §7)."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median

import numpy as np

from eval.engine.table import Cell, ReferenceRow, Table
from stages.shape.kit import Assembly, Kit
from stages.strings.encoder import NotConnectedError
from stages.strings.kit_strings import KitStrings
from stages.strings.settings import Edges
from stages.strings.statistics import measure_string

COLUMNS = (
    "shapes of",
    "edges",
    "shapes",
    "without",
    "parts",
    "cycle rank",
    "canonical",
    "random",
    "longest",
    "cycles",
    "most cycles",
)

PUBLISHED = (ReferenceRow("all scenes", "strings §6, §7", {"parts": "23 to 70", "canonical": "45 to 85"}),)

NOTES = (
    "Edges: the contacts in the strings: all, faces, or a spanning tree. Parts and cycle rank of the shapes: medians. "
    "Canonical, random: tokens of the canonical string and of a random one, medians. Longest: tokens of the longest. "
    "Cycles: edges that a canonical string writes as cycle numbers, median and greatest. Without: shapes without a "
    "string, whose graph is not connected. Published values count characters.",
)


def corpus_row(
    name: str, kit: Kit, shapes: Sequence[Assembly], edges: Edges, rng: np.random.Generator
) -> tuple[Cell, ...]:
    """Return the row of some shapes of a kit, each with a canonical and a random string."""
    writer = KitStrings(kit, edges)
    measured, ranks, parts = [], [], []
    for shape in shapes:
        try:
            strings = writer.strings(writer.graph(shape), 1, rng)
        except NotConnectedError:
            continue
        measured.append([measure_string(string.string) for string in strings])
        ranks.append(len(shape.edges) - len(shape) + 1)
        parts.append(len(shape))
    if not measured:
        return (name, edges, 0, len(shapes), *[""] * (len(COLUMNS) - 4))
    return (
        name,
        edges,
        len(measured),
        len(shapes) - len(measured),
        _median(parts),
        _median(ranks),
        _median([strings[0].tokens for strings in measured]),
        _median([strings[-1].tokens for strings in measured]),
        max(string.tokens for strings in measured for string in strings),
        _median([strings[0].cycles for strings in measured]),
        max(strings[0].cycles for strings in measured),
    )


def corpora_table(rows: Sequence[tuple[Cell, ...]]) -> Table:
    """Return the table of rows of `corpus_row`, with the values of the paper."""
    return Table("Tokens and cycles of strings", COLUMNS, tuple(rows), NOTES, PUBLISHED)


def _median(values: Sequence[int]) -> int:
    return round(median(values))
