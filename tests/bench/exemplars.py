"""Benchmark many models one by one: with the config that `shapemill inspect` writes, or with the README's.

python -m tests.bench.exemplars [--out FOLDER] [--minutes 10] [--template] MODEL...

A MODEL is a file, some files of one kit with spaces between them, as in MESH="a.glb b.glb", or a folder of models.
Each goes through inspect, then through autoconfig, exemplars, variations and proportions, with one worker, as users do.
Prints a row of a Markdown table for each as soon as it has ended, and then the mean error of the forecast: of the share
of new plans, foretold against made. A folder in FOLDER holds its config, its pictures and
a sheet of the most different variants, to be judged by eye.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from pipeline.paths import DatasetPaths
from pipeline.records import read_record
from stages.inspection.config_text import dataset_name

HEADER = (
    "| model | parts / types | up, tolerance, kinds, grammar, hubs | yield estimate | new plans, foretold | made "
    "| chosen of pool | histograms | E | copied | mixed | inspect, CPU s | making, CPU s | MB |\n"
    "|---|---:|---|---|---:|---:|---|---:|---:|---:|---:|---:|---:|---:|"
)
STAGES = ("autoconfig", "exemplars", "variations", "proportions")
TEMPLATE = """\
name: {name}
seed: 1
exemplars:
  kits:
    - name: {name}
      shapes: {shapes}
      credit: {{author: Jane Doe, source: https://example.org, license: CC-BY-4.0}}
variations:
  samples_per_kit: 1000
"""
"""The README's."""


@dataclass(frozen=True)
class Ended:
    """How a command ended.

    seconds: CPU seconds of all its processes.
    megabytes: largest memory of one process.
    stdout, stderr: what it printed.
    late: whether it was stopped.
    """

    seconds: float
    megabytes: float
    stdout: str
    stderr: str
    late: bool


def run(arguments: Sequence[str], minutes: float) -> Ended:
    """Run `python -m` with arguments for at most `minutes`."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with subprocess.Popen(
        [sys.executable, "-m", *arguments], stdout=-1, stderr=-1, text=True, start_new_session=True
    ) as process:
        late = False
        try:
            stdout, stderr = process.communicate(timeout=60 * minutes)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGTERM)
            stdout, stderr = process.communicate()
            late = True
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Ended(seconds, after.ru_maxrss / 1024, stdout, stderr, late)


def measured(models: Sequence[Path], folder: Path, minutes: float, template: bool) -> tuple[str, float | None]:
    """Return the row of one kit of models, and the error of the foretold share of new plans; None if none is made."""
    name = "-".join(dict.fromkeys(dataset_name([path]) for path in models))[:60]
    folder /= name  # the name of a kit must differ from that of its first model
    inspected = run(["pipeline", "inspect", "--json", "--out", str(folder / "inspect"), *map(str, models)], minutes)
    if not inspected.stdout:
        why = "took too long" if inspected.late else inspected.stderr.strip().splitlines()[-1]
        return f"| {name} | | | {why} | | | | | | | | {inspected.seconds:.0f} | | {inspected.megabytes:.0f} |", None
    inspection = json.loads(inspected.stdout)
    config = Path(inspection["files"]["config"])
    if template:
        config = folder / "template" / config.name
        config.parent.mkdir(parents=True, exist_ok=True)
        config.write_text(
            TEMPLATE.format(name=config.stem, shapes=json.dumps(list(map(str, models)))), encoding="utf-8"
        )
    made, new_plans, ends = _make(config, folder, minutes)
    resolved, estimate = inspection["autoconfig"]["resolved"], inspection["yield_estimate"]
    settings = {
        key: value for key, value in resolved.items() if key != "disconnected" and not key.startswith("require.")
    }
    foretold = float(estimate["kinds"]["shares"].get("new plan", 0.0))
    parts = sum(len(model["parts"]) for model in inspection.get("models", [inspection]))
    row = [
        name,
        f"{parts} / {len(inspection['types'])}",
        ", ".join(map(_setting, settings.values())),
        estimate["sentence"],
        f"{foretold:.0%}",
        "" if new_plans is None else f"{new_plans:.0%}",
        *ends,
        f"{inspected.seconds:.0f}",
        f"{made.seconds:.0f}",
        f"{max(inspected.megabytes, made.megabytes):.0f}",
    ]
    return f"| {' | '.join(row)} |", None if new_plans is None else abs(new_plans - foretold)


def _setting(value: Any) -> str:
    return "+".join(value) if isinstance(value, list) else str(value)


def _make(config: Path, folder: Path, minutes: float) -> tuple[Ended, float | None, list[str]]:
    """Make the variants of a config; return how all its stages ended together, the share of new plans, and the cells of
    a row."""
    spent, peak, left = 0.0, 0.0, minutes
    for stage in STAGES:
        ended = run(["pipeline", "run", stage, "--config", str(config), "--out", str(folder), "--workers", "1"], left)
        spent, peak = spent + ended.seconds, max(peak, ended.megabytes)
        if ended.late:
            break
    whole = Ended(spent, peak, ended.stdout, ended.stderr, ended.late)
    resized = read_record(DatasetPaths(folder, config.stem).stage("proportions").records / f"{config.stem}-choice.json")
    if resized is not None:
        return whole, 0.0, [f"{sum(resized.summary['shapes'].values()):,} in other proportions", *[""] * 4]
    record = read_record(
        DatasetPaths(folder, config.stem).stage("variations").records / f"{config.stem}-assignment.json"
    )
    if record is None:
        return whole, None, ["stopped at the limit" if ended.late else _why(ended), *[""] * 4]
    (summary,) = record.summary["kits"].values()
    run(["pipeline", "sheets", "--config", str(config), "--out", str(folder)], minutes)
    return whole, summary["new_plans"], list(_cells(summary))


def _why(ended: Ended) -> str:
    """Return the line that says why a run ended without variants."""
    lines = [line for line in (ended.stdout + ended.stderr).splitlines() if line.strip()]
    reasons = [line for line in lines if "found no variant" in line]
    return (reasons or lines or ["nothing"])[-1]


def _cells(summary: Mapping[str, Any]) -> Iterator[str]:
    low_diversity = summary["low_diversity"]
    yield f"{summary['variants']:,} of {summary['pool']:,}{', ' + low_diversity if low_diversity else ''}"
    yield f"{summary['histograms']:,}"
    yield f"{summary['distance']:.2f}"
    yield f"{summary['copied_share']:.0%}"
    yield f"{summary['mixed']:.0%}"


def kits(text: str) -> Iterator[list[Path]]:
    """Yield the kits that one argument names."""
    if Path(text).is_dir():
        yield from ([path] for path in sorted(Path(text).rglob("*.glb")))
    else:
        yield [Path(text)] if Path(text).exists() else [Path(word) for word in text.split()]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench.exemplars", description=__doc__.splitlines()[0])
    parser.add_argument("models", nargs="+", metavar="MODEL")
    parser.add_argument("--out", type=Path, default=Path("datasets/exemplars-bench"))
    parser.add_argument("--minutes", type=float, default=10.0, help="as long as inspecting or making may take")
    parser.add_argument("--template", action="store_true", help="the README's config instead of the one of inspect")
    options = parser.parse_args()
    print(HEADER, flush=True)
    errors: list[float] = []
    # one process for each, since the peak of memory is that of all children of a process
    with ProcessPoolExecutor(1, get_context("spawn"), max_tasks_per_child=1) as one_by_one:
        for models in [kit for text in options.models for kit in kits(text)]:
            job = one_by_one.submit(measured, models, options.out, options.minutes, options.template)
            row, error = job.result()
            print(row, flush=True)
            errors += [] if error is None else [error]
    if errors:
        print(f"\nmean error of the foretold share of new plans: {sum(errors) / len(errors):.0%} of {len(errors)} kits")


if __name__ == "__main__":
    main()
