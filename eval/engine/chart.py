"""Plots as SVG for an HTML page. Colours come from the page's style, so plots follow its light and dark themes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape

from eval.engine.evaluation import Chart

NUM_COLORS = 8
"""Classes `line0`, `line1`, ... of the page's style; further lines reuse them."""

MAX_MARKED_POINTS = 12
"""A line of at most this many points has a dot at each."""

CHART_WIDTH, CHART_HEIGHT = 520, 300
LEFT_EDGE, RIGHT_EDGE, TOP_EDGE, BOTTOM_EDGE = 52, 508, 12, 256
"""Of the plot area, in pixels; y points down."""


def chart_svg(chart: Chart) -> str:
    """Return the plot without a legend, its texts escaped. Raises ValueError for a chart without points."""
    points = [point for line in chart.lines.values() for point in line]
    if not points:
        raise ValueError(f"{chart.title} has no points")
    x_ticks = ticks(min(x for x, _ in points), max(x for x, _ in points))
    y_ticks = ticks(min(0.0, *(y for _, y in points)), max(y for _, y in points))

    def at(x: float, y: float) -> tuple[float, float]:
        across = (x - x_ticks[0]) / (x_ticks[-1] - x_ticks[0])
        up = (y - y_ticks[0]) / (y_ticks[-1] - y_ticks[0])
        return LEFT_EDGE + (RIGHT_EDGE - LEFT_EDGE) * across, BOTTOM_EDGE - (BOTTOM_EDGE - TOP_EDGE) * up

    size = f'viewBox="0 0 {CHART_WIDTH} {CHART_HEIGHT}"'
    elements = [f'<svg class="chart" {size} role="img" aria-label="{escape(chart.title)}">']
    for x in x_ticks:
        left, _ = at(x, y_ticks[0])
        elements.append(f'<text x="{left:.1f}" y="{BOTTOM_EDGE + 17}" text-anchor="middle">{_number(x)}</text>')
    for y in y_ticks:
        _, top = at(x_ticks[0], y)
        elements.append(f'<line class="grid" x1="{LEFT_EDGE}" x2="{RIGHT_EDGE}" y1="{top:.1f}" y2="{top:.1f}"/>')
        elements.append(f'<text x="{LEFT_EDGE - 7}" y="{top + 4:.1f}" text-anchor="end">{_number(y)}</text>')
    place = f'x="{(LEFT_EDGE + RIGHT_EDGE) / 2}" y="{CHART_HEIGHT - 6}"'
    elements.append(f'<text class="axis" {place} text-anchor="middle">{escape(chart.x_label)}</text>')
    for number, line in enumerate(chart.lines.values()):
        color = f"line{number % NUM_COLORS}"
        corners = [at(x, y) for x, y in line]
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in corners)
        elements.append(f'<polyline class="line {color}" points="{path}"/>')
        if len(corners) <= MAX_MARKED_POINTS:
            elements += [f'<circle class="dot {color}" cx="{x:.1f}" cy="{y:.1f}" r="3"/>' for x, y in corners]
    return "".join([*elements, "</svg>"])


def ticks(low: float, high: float) -> Sequence[float]:
    """Return four to seven round numbers at equal steps, from at most `low` to at least `high`."""
    if high <= low:
        low, high = low - 0.5, low + 0.5
    rough = (high - low) / 5
    power = 10.0 ** math.floor(math.log10(rough))
    step = min((power * size for size in (1, 2, 5, 10)), key=lambda size: abs(math.log(size / rough)))
    first, last = math.floor(low / step + 1e-9), math.ceil(high / step - 1e-9)
    return [round(step * number, 12) for number in range(first, last + 1)]


def _number(value: float) -> str:
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.4g}"
