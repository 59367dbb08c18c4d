"""The kept report of `make bench`: Markdown for people and JSON for the next run, which marks what has changed."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

from tests.bench.measure import Measure

TABLE_HEADER = "| what | ours, a second and core | peer | ratio | change | note |\n|---|---:|---:|---:|---:|---|"
NOISE_SHARE = 0.25
"""Relative difference from the last kept figure that may be noise: CPU seconds differ by a fifth on a busy machine."""


def figures(path: Path) -> dict[str, float]:
    """Return our figures of a kept report by name; empty without a report."""
    if not path.is_file():
        return {}
    return {entry["name"]: entry["ours"] for entry in json.loads(path.read_text(encoding="utf-8"))["measures"]}


def change(measure: Measure, kept: dict[str, float]) -> str:
    """Return the change from the last kept measure, in bold beyond noise; `new` without one."""
    before = kept.get(measure.name)
    if not before:
        return "new" if kept else "–"
    ratio = measure.ours / before
    said = f"{ratio - 1:+.0%}"
    return said if 1 - NOISE_SHARE <= ratio <= 1 / (1 - NOISE_SHARE) else f"**{said}**"


def row(measure: Measure, kept: dict[str, float]) -> str:
    """Return a measure as a row of the table."""
    peer = f"{_figure(measure.peer)} ({measure.peer_name})" if measure.peer is not None else "–"
    ratio = f"{measure.ours / measure.peer:.2g}×" if measure.peer else "–"
    ours = f"{_figure(measure.ours)} {measure.unit}"
    return f"| {measure.name} | {ours} | {peer} | {ratio} | {change(measure, kept)} | {measure.note} |"


def keep(path: Path, made: Sequence[Measure]) -> None:
    """Write the report as JSON to `path` and as Markdown next to it, with date and size of the machine."""
    kept = figures(path)
    machine = {
        "date": f"{datetime.now(UTC):%Y-%m-%d}",
        "cores": os.cpu_count(),
        "memory_gb": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9),
        "machine": platform.machine(),
        "load": round(os.getloadavg()[1], 1),
    }
    said = (
        f"Measured on {machine['date']}, {machine['cores']} cores ({machine['machine']}), {machine['memory_gb']} GB of "
        f"memory, load {machine['load']} over five minutes. Bold: over {NOISE_SHARE:.0%} from the last kept report."
    )
    table = "\n".join([TABLE_HEADER, *(row(measure, kept) for measure in made)])
    path.with_suffix(".md").write_text(f"# What Shapemill takes\n\n{said}\n\n{table}\n", encoding="utf-8")
    path.write_text(
        json.dumps({**machine, "measures": [asdict(measure) for measure in made]}, indent=1) + "\n", encoding="utf-8"
    )


def _figure(value: float) -> str:
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"
