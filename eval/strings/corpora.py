"""How long the strings of a kit's shapes are, and how many cycles they tell of, by what they leave out (strings §7)."""

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
    "strings tell of",
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
    "Parts and cycle rank of the shapes, medians. Canonical, random: tokens of the canonical string and of a random "
    "one, medians; longest: tokens of the longest. Cycles: edges that a canonical string tells of by cycle numbers, "
    "median and most. Without: shapes that their contacts do not hold in one piece; they have no string. Published are "
    "numbers of characters.",
)


def corpus_row(
    name: str, kit: Kit, shapes: Sequence[Assembly], edges: Edges, rng: np.random.Generator
) -> tuple[Cell, ...]:
    """The row of some shapes of a kit, of each of which a canonical and a random string are written."""
    writer = KitStrings(kit, edges)
    figures, ranks, parts = [], [], []
    for shape in shapes:
        try:
            strings = writer.strings(writer.graph(shape), 1, rng)
        except NotConnectedError:
            continue
        figures.append([measure_string(each.string) for each in strings])
        ranks.append(len(shape.edges) - len(shape) + 1)
        parts.append(len(shape))
    if not figures:
        return (name, edges, 0, len(shapes), *[""] * (len(COLUMNS) - 4))
    return (
        name,
        edges,
        len(figures),
        len(shapes) - len(figures),
        _whole(parts),
        _whole(ranks),
        _whole([each[0].tokens for each in figures]),
        _whole([each[-1].tokens for each in figures]),
        max(one.tokens for each in figures for one in each),
        _whole([each[0].cycles for each in figures]),
        max(each[0].cycles for each in figures),
    )


def corpora_table(rows: Sequence[tuple[Cell, ...]]) -> Table:
    """The rows of `corpus_row`, with what the paper says of its own strings."""
    return Table("Tokens and cycles of strings", COLUMNS, tuple(rows), NOTES, PUBLISHED)


def _whole(values: Sequence[int]) -> int:
    return round(median(values))
