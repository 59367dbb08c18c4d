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

HEADER = "| what | ours, a second and core | peer | ratio | change | note |\n|---|---:|---:|---:|---:|---|"
NOISE = 0.25
"""Share by which a figure may differ from the last kept one by noise: on a busy machine with two threads a core, CPU
seconds of the same work were seen to differ by a fifth."""


def figures(path: Path) -> dict[str, float]:
    """Our figures of a kept report by name; none where there is none."""
    if not path.is_file():
        return {}
    return {each["name"]: each["ours"] for each in json.loads(path.read_text())["measures"]}


def change(measure: Measure, kept: dict[str, float]) -> str:
    """How a measure differs from the last kept one, in bold beyond noise; `new` for one that was not there."""
    before = kept.get(measure.name)
    if not before:
        return "new" if kept else "–"
    ratio = measure.ours / before
    said = f"{ratio - 1:+.0%}"
    return said if 1 - NOISE <= ratio <= 1 / (1 - NOISE) else f"**{said}**"


def row(measure: Measure, kept: dict[str, float]) -> str:
    """One measure as a row of the table."""
    peer = f"{_figure(measure.peer)} ({measure.peer_name})" if measure.peer is not None else "–"
    ratio = f"{measure.ours / measure.peer:.2g}×" if measure.peer else "–"
    ours = f"{_figure(measure.ours)} {measure.unit}"
    return f"| {measure.name} | {ours} | {peer} | {ratio} | {change(measure, kept)} | {measure.note} |"


def keep(path: Path, made: Sequence[Measure]) -> None:
    """Write the JSON `path` and the Markdown beside it, with date and size of the machine; figures of pieces that were
    not measured now stay in neither."""
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
        f"memory, load {machine['load']} over five minutes. Bold: more than {NOISE:.0%} from the last kept report."
    )
    table = "\n".join([HEADER, *(row(each, kept) for each in made)])
    path.with_suffix(".md").write_text(f"# What Shapemill takes\n\n{said}\n\n{table}\n")
    path.write_text(json.dumps({**machine, "measures": [asdict(each) for each in made]}, indent=1) + "\n")


def _figure(value: float) -> str:
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"
