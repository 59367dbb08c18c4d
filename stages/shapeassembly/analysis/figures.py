"""Figure of how many programs, and how many assemblies, few structures stand for (shapeassembly figure 10)."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence

import numpy as np

from stages.shapeassembly.analysis.statistics import cluster_curves
from stages.shapeassembly.syntax.program import AssemblyProgram


def cluster_figure(programs: Mapping[str, Sequence[AssemblyProgram]]) -> bytes:
    """A PNG: for each category the share of its programs (left) and assemblies (right) that its most frequent
    structures have, against their number."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 3.6), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, 2, sharey=True)
    for category, each in programs.items():
        for panel, curve in zip(panels, cluster_curves(each), strict=True):
            panel.plot(np.arange(1, len(curve) + 1), 100 * curve, label=category)
    for panel, title in zip(panels, ("whole programs", "assemblies"), strict=True):
        panel.set(title=title, xscale="log", xlabel="structures, most frequent first", ylim=(0, 100))
        panel.spines[["top", "right"]].set_visible(False)
        panel.grid(alpha=0.25)
    panels[0].set_ylabel("share captured, %")
    panels[1].legend(frameon=False, loc="lower right")
    stream = io.BytesIO()
    figure.savefig(stream, metadata={"Software": None})
    return stream.getvalue()
