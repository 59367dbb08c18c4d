"""A plot as SVG that stands in a page: it takes its colours from the page's style, so it follows light and dark."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape

from eval.engine.evaluation import Chart

NUM_COLORS = 8
"""So many lines have colours of their own, the classes `line0`, `line1` and so on; then they begin again."""

MAX_MARKED_POINTS = 12
"""A line of at most so many points has a dot at each."""

CHART_WIDTH, CHART_HEIGHT = 520, 300
LEFT_MARGIN, RIGHT_MARGIN, TOP_MARGIN, BOTTOM_MARGIN = 52, 12, 12, 44


def chart_svg(curve: Chart) -> str:
    """The plot of a curve; its lines are named by whoever shows it. Markup: what the curve says is escaped.

    Raises ValueError for a curve without points.
    """
    points = [point for line in curve.lines.values() for point in line]
    if not points:
        raise ValueError(f"{curve.title} has no points")
    across = ticks(min(x for x, _ in points), max(x for x, _ in points))
    up = ticks(min(0.0, *(y for _, y in points)), max(y for _, y in points))

    def at(x: float, y: float) -> tuple[float, float]:
        return (
            LEFT_MARGIN + (CHART_WIDTH - LEFT_MARGIN - RIGHT_MARGIN) * (x - across[0]) / (across[-1] - across[0]),
            CHART_HEIGHT - BOTTOM_MARGIN - (CHART_HEIGHT - BOTTOM_MARGIN - TOP_MARGIN) * (y - up[0]) / (up[-1] - up[0]),
        )

    drawn = [
        f'<svg class="chart" viewBox="0 0 {CHART_WIDTH} {CHART_HEIGHT}" role="img" aria-label="{escape(curve.title)}">'
    ]
    for x in across:
        left, _ = at(x, up[0])
        drawn.append(
            f'<text x="{left:.1f}" y="{CHART_HEIGHT - BOTTOM_MARGIN + 17}" text-anchor="middle">{_number(x)}</text>'
        )
    for y in up:
        _, top = at(across[0], y)
        drawn.append(
            f'<line class="grid" x1="{LEFT_MARGIN}" x2="{CHART_WIDTH - RIGHT_MARGIN}" y1="{top:.1f}" y2="{top:.1f}"/>'
        )
        drawn.append(f'<text x="{LEFT_MARGIN - 7}" y="{top + 4:.1f}" text-anchor="end">{_number(y)}</text>')
    middle = (LEFT_MARGIN + CHART_WIDTH - RIGHT_MARGIN) / 2
    drawn.append(
        f'<text class="axis" x="{middle}" y="{CHART_HEIGHT - 6}" text-anchor="middle">{escape(curve.across)}</text>'
    )
    for place, line in enumerate(curve.lines.values()):
        corners = [at(x, y) for x, y in line]
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in corners)
        drawn.append(f'<polyline class="line line{place % NUM_COLORS}" points="{path}"/>')
        if len(corners) <= MAX_MARKED_POINTS:
            drawn += [
                f'<circle class="dot line{place % NUM_COLORS}" cx="{x:.1f}" cy="{y:.1f}" r="3"/>' for x, y in corners
            ]
    return "".join([*drawn, "</svg>"])


def ticks(low: float, high: float) -> Sequence[float]:
    """Round numbers, four to seven of them at equal steps, the first at most `low` and the last at least `high`."""
    if high <= low:
        low, high = low - 0.5, low + 0.5
    rough = (high - low) / 5
    power = 10.0 ** math.floor(math.log10(rough))
    step = min((power * size for size in (1, 2, 5, 10)), key=lambda each: abs(math.log(each / rough)))
    first, last = math.floor(low / step + 1e-9), math.ceil(high / step - 1e-9)
    return [round(step * number, 12) for number in range(first, last + 1)]


def _number(value: float) -> str:
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.4g}"
