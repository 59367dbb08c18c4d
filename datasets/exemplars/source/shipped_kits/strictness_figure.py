"""The figure of what each strictness level admits: datasets/exemplars/strictness.png."""

from __future__ import annotations

import io
from itertools import combinations_with_replacement
from typing import Any

import numpy as np

from stages.shape.graphs.neighbourhoods import STRICTNESS, admits
from stages.shape.kit import Grammar, Multiset, Strictness

CENTRE, WALL, FLOOR, DOOR = range(4)
"""Part types of the example."""
TYPE_COLORS = {CENTRE: "#3d3a40", WALL: "#c8693f", FLOOR: "#4f8a8b", DOOR: "#e0b04a"}
OBSERVED: tuple[Multiset, ...] = (((WALL, 2), (FLOOR, 1)), ((FLOOR, 1), (DOOR, 1)))
MAX_NEIGHBOURS = 4
REFUSED: tuple[tuple[Multiset, str], ...] = (
    (((DOOR, 1),), "never\nthat few"),
    (((WALL, 2), (FLOOR, 2)), "never\nthat many"),
    (((CENTRE, 1), (FLOOR, 1)), "never\naround it"),
)
WORDS: dict[Strictness, str] = {
    "multiset": "only what was observed",
    "count_and_set": "also an observed number, with its set of types",
    "count_and_pairs": "also an observed number, each two types observed together",
    "count_and_types": "also an observed number, each type observed: the published rule",
}
PAPER = "#fbf9f5"


def newly_admitted() -> list[tuple[Strictness, list[Multiset]]]:
    """Return for each level, the strictest first, the neighbourhoods that it admits and the previous level does not."""
    every = [
        tuple((kind, chosen.count(kind)) for kind in sorted(set(chosen)))
        for size in range(1, MAX_NEIGHBOURS + 1)
        for chosen in combinations_with_replacement((WALL, FLOOR, DOOR), size)
    ]
    levels: list[tuple[Strictness, list[Multiset]]] = []
    known: set[Multiset] = set()
    for strictness in STRICTNESS:
        grammar = Grammar({CENTRE: dict.fromkeys(OBSERVED, 1)}, (), {}, strictness)
        added = [around for around in every if around not in known and admits(grammar, CENTRE, around)]
        levels.append((strictness, added))
        known.update(added)
    return levels


def strictness_figure() -> bytes:
    """Draw the figure as a PNG."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rows: list[tuple[str, str, list[tuple[Multiset, str]]]] = [
        ("observed", "around one type of part", [(around, "") for around in OBSERVED])
    ]
    rows += [(level, WORDS[level], [(around, "") for around in added]) for level, added in newly_admitted()]
    rows.append(("refused", "by every level", list(REFUSED)))
    # The strictest level admits what was observed; it is shown once.
    rows[1] = (rows[1][0], rows[1][1] + ": the two above", [])
    width = max(len(glyphs) for _, _, glyphs in rows)
    figure = Figure(figsize=(1.05 * width + 0.4, 1.55 * len(rows) - 0.6), dpi=110, facecolor=PAPER)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    y = 0.0
    for title, words, glyphs in rows:
        axes.text(0.0, y, title, fontsize=11, fontweight="bold", color="#201e22", family="DejaVu Sans", va="center")
        axes.text(0.0 + 0.115 * len(title) + 0.2, y, words, fontsize=9.5, color="#7a7470", va="center")
        y -= 0.85
        for column, (around, why) in enumerate(glyphs):
            _draw_glyph(axes, 0.45 + 1.05 * column, y, around, faded=title == "refused")
            axes.text(0.45 + 1.05 * column, y - 0.62, why, fontsize=7, color="#7a7470", ha="center", va="center")
        y -= 1.0 if glyphs else -0.25
    axes.set(xlim=(-0.2, 1.05 * width + 0.1), ylim=(y + 0.1, 0.45), aspect="equal")
    axes.axis("off")
    stream = io.BytesIO()
    FigureCanvasAgg(figure).print_png(stream, metadata={"Software": None})
    return stream.getvalue()


def _draw_glyph(axes: Any, x: float, y: float, around: Multiset, faded: bool) -> None:
    """Draw a part and its neighbours around it."""
    types = [other for other, count in around for _ in range(count)]
    alpha = 0.45 if faded else 1.0
    for number, other in enumerate(types):
        angle = np.pi / 2 + 2 * np.pi * number / len(types)
        at = x + 0.33 * np.cos(angle), y + 0.33 * np.sin(angle)
        axes.plot([x, at[0]], [y, at[1]], color="#b9b2a8", linewidth=2, zorder=1, alpha=alpha)
        axes.plot(*at, marker="o", markersize=11, color=TYPE_COLORS[other], zorder=2, alpha=alpha)
    axes.plot(x, y, marker="s", markersize=11, color=TYPE_COLORS[CENTRE], zorder=3, alpha=alpha)
