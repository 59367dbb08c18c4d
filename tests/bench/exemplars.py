"""What each of many models gives by itself: through `make inspect` and its config untouched, or through the README's.

python -m tests.bench.exemplars [--out FOLDER] [--minutes 10] [--template] MODEL...

A MODEL is a file, some files of one kit with spaces between them, as in MESH="a.glb b.glb", or a folder of models.
Each goes through inspect, then through autoconfig, exemplars, variations and proportions, with one worker, as users do.
Prints a row of a Markdown table for each, as soon as it has ended, and leaves in a folder of FOLDER for each the
config, what inspect drew, and a sheet of the most different variants, which somebody has to look at: no figure tells a
good shape.
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
    "| model | parts / types | up, tolerance, kinds, grammar, hubs | forecast | chosen of pool | histograms | E "
    "| copied | mixed | inspect, CPU s | making, CPU s | MB |\n"
    "|---|---:|---|---|---|---:|---:|---:|---:|---:|---:|---:|"
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
    """How a command ended. seconds: of CPU, all its processes'; megabytes: the most that one of these held; said: what
    it printed to stdout, and complained: to stderr; late: whether it was stopped."""

    seconds: float
    megabytes: float
    said: str
    complained: str
    late: bool


def run(arguments: Sequence[str], minutes: float) -> Ended:
    """`python -m` with some arguments, as long as it takes no longer than so many minutes."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with subprocess.Popen(
        [sys.executable, "-m", *arguments], stdout=-1, stderr=-1, text=True, start_new_session=True
    ) as made:
        late = False
        try:
            said, complained = made.communicate(timeout=60 * minutes)
        except subprocess.TimeoutExpired:
            os.killpg(made.pid, signal.SIGTERM)
            said, complained = made.communicate()
            late = True
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Ended(seconds, after.ru_maxrss / 1024, said, complained, late)


def measured(models: Sequence[Path], folder: Path, minutes: float, template: bool) -> str:
    """The row of one kit of models."""
    name = "-".join(dict.fromkeys(dataset_name([each]) for each in models))[:60]
    folder /= name  # a family is called as its first model is, and must not take its place
    inspected = run(["pipeline", "inspect", "--json", "--out", str(folder / "inspect"), *map(str, models)], minutes)
    if not inspected.said:
        why = "took too long" if inspected.late else inspected.complained.strip().splitlines()[-1]
        return f"| {name} | | | {why} | | | | | | {inspected.seconds:.0f} | | {inspected.megabytes:.0f} |"
    seen = json.loads(inspected.said)
    config = Path(seen["files"]["config"])
    if template:
        config = folder / "template" / config.name
        config.parent.mkdir(parents=True, exist_ok=True)
        config.write_text(TEMPLATE.format(name=config.stem, shapes=json.dumps([str(each) for each in models])))
    made, ends = _made(config, folder, minutes)
    chosen, foreseen = seen["autoconfig"]["resolved"], seen["yield_estimate"]
    decided = {key: each for key, each in chosen.items() if key != "disconnected" and not key.startswith("require.")}
    parts = sum(len(each["parts"]) for each in seen.get("models", [seen]))
    row = [
        name,
        f"{parts} / {len(seen['types'])}",
        ", ".join(map(_setting, decided.values())),
        foreseen["sentence"],
        *ends,
        f"{inspected.seconds:.0f}",
        f"{made.seconds:.0f}",
        f"{max(inspected.megabytes, made.megabytes):.0f}",
    ]
    return f"| {' | '.join(row)} |"


def _setting(value: Any) -> str:
    return "+".join(value) if isinstance(value, list) else str(value)


def _made(config: Path, folder: Path, minutes: float) -> tuple[Ended, list[str]]:
    """How the making of a config's variants ended, all its stages together, and what a row says of them."""
    spent, peak, left = 0.0, 0.0, minutes
    for stage in STAGES:
        ended = run(["pipeline", "run", stage, "--config", str(config), "--out", str(folder), "--workers", "1"], left)
        spent, peak = spent + ended.seconds, max(peak, ended.megabytes)
        if ended.late:
            break
    whole = Ended(spent, peak, ended.said, ended.complained, ended.late)
    chosen = read_record(DatasetPaths(folder, config.stem).stage("proportions").records / f"{config.stem}-choice.json")
    if chosen is not None:
        return whole, [f"{sum(chosen.summary['shapes'].values()):,} in other proportions", *[""] * 4]
    record = read_record(
        DatasetPaths(folder, config.stem).stage("variations").records / f"{config.stem}-assignment.json"
    )
    if record is None:
        return whole, ["stopped at the limit" if ended.late else _why(ended), *[""] * 4]
    (found,) = record.summary["kits"].values()
    run(["stages.variations.report.sheet", "--config", str(config), "--out", str(folder)], minutes)
    return whole, list(_cells(found))


def _why(ended: Ended) -> str:
    """Why a run ended without variants, by its own words: the lines before the last, which names what is set aside."""
    said = [each for each in (ended.said + ended.complained).splitlines() if each.strip()]
    found = [each for each in said if "found no variant" in each]
    return (found or said or ["nothing"])[-1]


def _cells(found: Mapping[str, Any]) -> Iterator[str]:
    yield f"{found['variants']:,} of {found['pool']:,}{', ' + found['dull'] if found['dull'] else ''}"
    yield f"{found['histograms']:,}"
    yield f"{found['distance']:.2f}"
    yield f"{found['copied']:.0%}"
    yield f"{found['mixed']:.0%}"


def kits(text: str) -> Iterator[list[Path]]:
    """The kits that one argument names."""
    if Path(text).is_dir():
        yield from ([each] for each in sorted(Path(text).rglob("*.glb")))
    else:
        yield [Path(text)] if Path(text).exists() else [Path(each) for each in text.split()]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench.exemplars", description=__doc__.splitlines()[0])
    parser.add_argument("models", nargs="+", metavar="MODEL")
    parser.add_argument("--out", type=Path, default=Path("datasets/exemplars-bench"))
    parser.add_argument("--minutes", type=float, default=10.0, help="as long as inspecting or making may take")
    parser.add_argument("--template", action="store_true", help="the README's config instead of the one of inspect")
    asked = parser.parse_args()
    print(HEADER, flush=True)
    # a process for each, for the peak of memory is that of all children that a process has ever had
    with ProcessPoolExecutor(1, get_context("spawn"), max_tasks_per_child=1) as one_by_one:
        for models in [each for text in asked.models for each in kits(text)]:
            row = one_by_one.submit(measured, models, asked.out, asked.minutes, asked.template)
            print(row.result(), flush=True)


if __name__ == "__main__":
    main()
