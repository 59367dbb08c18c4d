"""The picture that explains `grammar`: which neighbourhoods each level of strictness admits, on an example.

python -m stages.exemplars.strictness [--picture datasets/exemplars/strictness.png]

The example is judged by `stages.shape.graphs.neighbourhoods` itself, so the picture cannot say what the code does
not do.
"""

from __future__ import annotations

import argparse
import io
from itertools import combinations_with_replacement
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.paths import write_file
from stages.shape.graphs.neighbourhoods import STRICTNESS, admits
from stages.shape.kit import Grammar, Multiset, Strictness

CENTRE, WALL, FLOOR, DOOR = range(4)
COLORS = {CENTRE: "#3d3a40", WALL: "#c8693f", FLOOR: "#4f8a8b", DOOR: "#e0b04a"}
SEEN: tuple[Multiset, ...] = (((WALL, 2), (FLOOR, 1)), ((FLOOR, 1), (DOOR, 1)))
MOST = 4
"""Neighbourhoods of at most so many parts are looked at."""
REFUSED: tuple[tuple[Multiset, str], ...] = (
    (((DOOR, 1),), "never\nso few"),
    (((WALL, 2), (FLOOR, 2)), "never\nso many"),
    (((CENTRE, 1), (FLOOR, 1)), "never\naround it"),
)
WORDS: dict[Strictness, str] = {
    "multiset": "only what was seen",
    "count_and_set": "also as many, of the same set of types",
    "count_and_pairs": "also as many as seen once, each two types seen together",
    "count_and_types": "also as many as seen once, each type seen beside it: the published rule",
}
PAPER = "#fbf9f5"


def newly_admitted() -> list[tuple[Strictness, list[Multiset]]]:
    """For each level, the strictest first, the neighbourhoods of the example that it admits and the one before does
    not."""
    every = [
        tuple((each, chosen.count(each)) for each in sorted(set(chosen)))
        for size in range(1, MOST + 1)
        for chosen in combinations_with_replacement((WALL, FLOOR, DOOR), size)
    ]
    levels: list[tuple[Strictness, list[Multiset]]] = []
    known: set[Multiset] = set()
    for strictness in STRICTNESS:
        grammar = Grammar({CENTRE: dict.fromkeys(SEEN, 1)}, (), {}, strictness)
        added = [each for each in every if each not in known and admits(grammar, CENTRE, each)]
        levels.append((strictness, added))
        known.update(added)
    return levels


def main() -> None:
    """Draw the picture."""
    parser = argparse.ArgumentParser(prog="python -m stages.exemplars.strictness", description="Draw what is admitted.")
    parser.add_argument("--picture", type=Path, default=Path("datasets/exemplars/strictness.png"))
    path = write_file(parser.parse_args().picture, _picture())
    print(f"{path}  {path.stat().st_size:,} bytes")


def _picture() -> bytes:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rows: list[tuple[str, str, list[tuple[Multiset, str]]]] = [
        ("seen", "around one type of part", [(each, "") for each in SEEN])
    ]
    rows += [(level, WORDS[level], [(each, "") for each in added]) for level, added in newly_admitted()]
    rows.append(("refused", "by every level", list(REFUSED)))
    # What was seen is what the strictest level admits; it is shown once.
    rows[1] = (rows[1][0], rows[1][1] + ": the two above", [])
    width = max(len(glyphs) for _, _, glyphs in rows)
    figure = Figure(figsize=(1.05 * width + 0.4, 1.55 * len(rows) - 0.6), dpi=110, facecolor=PAPER)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    y = 0.0
    for title, words, glyphs in rows:
        axes.text(0.0, y, title, fontsize=11, fontweight="bold", color="#201e22", family="DejaVu Sans", va="center")
        axes.text(0.0 + 0.115 * len(title) + 0.2, y, words, fontsize=9.5, color="#7a7470", va="center")
        y -= 0.85
        for place, (near, why) in enumerate(glyphs):
            _glyph(axes, 0.45 + 1.05 * place, y, near, faded=title == "refused")
            axes.text(0.45 + 1.05 * place, y - 0.62, why, fontsize=7, color="#7a7470", ha="center", va="center")
        y -= 1.0 if glyphs else -0.25
    axes.set(xlim=(-0.2, 1.05 * width + 0.1), ylim=(y + 0.1, 0.45), aspect="equal")
    axes.axis("off")
    stream = io.BytesIO()
    FigureCanvasAgg(figure).print_png(stream, metadata={"Software": None})
    return stream.getvalue()


def _glyph(axes: Any, x: float, y: float, near: Multiset, faded: bool) -> None:
    """A part and its neighbours around it."""
    types = [other for other, count in near for _ in range(count)]
    alpha = 0.45 if faded else 1.0
    for place, other in enumerate(types):
        angle = np.pi / 2 + 2 * np.pi * place / len(types)
        at = x + 0.33 * np.cos(angle), y + 0.33 * np.sin(angle)
        axes.plot([x, at[0]], [y, at[1]], color="#b9b2a8", linewidth=2, zorder=1, alpha=alpha)
        axes.plot(*at, marker="o", markersize=11, color=COLORS[other], zorder=2, alpha=alpha)
    axes.plot(x, y, marker="s", markersize=11, color=COLORS[CENTRE], zorder=3, alpha=alpha)


if __name__ == "__main__":
    main()
