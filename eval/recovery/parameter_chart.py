"""A bar chart of right parameters."""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np

from eval.recovery.methods import MethodResults
from stages.shape.arrays import BoolArray


def parameter_chart(results: Sequence[MethodResults], same: BoolArray) -> bytes:
    """Draw a bar for each parameter, as PNG, and a panel for each of some results of one program.

    Dark: the share of right values where the parameter is visible; light: within one class; a mark in the first panel:
    the share that is as good as right, by `same`, its `indistinguishable_parameters`.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    names = [parameter.name for parameter in results[0].program.parameters]
    figure = Figure(figsize=(1.2 + 3.4 * len(results), 0.6 + 0.17 * len(names)), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    rows = np.arange(len(names))
    panels = figure.subplots(1, len(results), squeeze=False, sharey=True)[0]
    for panel, result in zip(panels, results, strict=True):
        counts = result.visible.sum(axis=0)
        for right, color in ((result.near, "#b7cbe0"), (result.exact, "#2f5f8f")):
            share = np.where(counts > 0, (right & result.visible).sum(axis=0) / np.maximum(counts, 1), 0.0)
            panel.barh(rows, 100.0 * share, color=color)
        panel.set(xlabel="% right, within one class, | alike", xlim=(0, 100))
        panel.set_title(result.label, fontsize=7)
        panel.spines[["top", "right"]].set_visible(False)
    visible = results[0].visible[: len(same)]
    shown = np.flatnonzero(visible.any(axis=0))
    share = (same & visible).sum(axis=0)[shown] / visible.sum(axis=0)[shown]
    panels[0].plot(100.0 * share, rows[shown], "|", color="#b04a2f", markersize=5)
    panels[0].set_yticks(rows, names, fontsize=6)
    panels[0].invert_yaxis()
    stream = io.BytesIO()
    figure.savefig(stream, metadata={"Software": None})
    return stream.getvalue()
