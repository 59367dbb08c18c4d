"""Samples per CPU second of whole datasets and of each stage: small datasets, one worker, compiled code cached.

CPU seconds are those of the run and all its processes, including their start, which dominates a stage that makes
little. A second run over the finished dataset finds nothing to do and measures the overhead of the pipeline.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from pipeline.registry import find_stages, upstream
from tests.bench.measure import Measure

ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Dataset:
    """A config with smaller values by section: `small` to measure, `few` for the run before, which compiles.

    It is skipped without the folder `needs`.
    """

    config: str
    small: Mapping[str, Any]
    few: Mapping[str, Any]
    needs: str = "."


DATASETS = (
    Dataset("default", {"variations": {"samples_per_kit": 40}}, {"variations": {"samples_per_kit": 3}}),
    Dataset(
        "castle",
        {"variations": {"samples_per_kit": 60}},
        {"variations": {"samples_per_kit": 3}},
        "../shared/exemplars/a01_castle_tower",
    ),
    Dataset(
        "chairs",
        {"programs": {"mode": "random", "random": {"samples": 150}}},
        {"programs": {"mode": "random", "random": {"samples": 20}}},
    ),
    Dataset("shapeassembly", {}, {}),
)


def bench() -> Iterator[Measure]:
    """Measure each dataset as a whole, then its stages."""
    stages = upstream(find_stages(), "package")
    for dataset in DATASETS:
        if not (ROOT / dataset.needs).exists():
            continue
        with tempfile.TemporaryDirectory() as folder:
            seconds_by_stage(dataset, dataset.few, Path(folder) / "few", stages)
            out = Path(folder) / "out"
            seconds = seconds_by_stage(dataset, dataset.small, out, stages)
            again = seconds_by_stage(dataset, dataset.small, out, stages)
            samples = _samples(out)
        spent = sum(seconds.values())
        note = f"{samples} samples in {spent:.1f} CPU s; a run over finished shards: {sum(again.values()):.1f} CPU s"
        yield Measure(f"{dataset.config}: the whole pipeline", "samples", samples / spent, note=note)
        yield Measure(
            f"{dataset.config}: without the overhead of runs", "samples", samples / (spent - sum(again.values()))
        )
        for stage in stages:
            if seconds[stage] - again[stage] > 0.02 * spent:
                said = f"{seconds[stage]:.1f} CPU s, {seconds[stage] / spent:.0%}"
                yield Measure(f"{dataset.config}: {stage}", "samples", samples / seconds[stage], note=said)


def seconds_by_stage(dataset: Dataset, changes: Mapping[str, Any], out: Path, stages: list[str]) -> dict[str, float]:
    """Return the CPU seconds of each stage of one run."""
    config = yaml.safe_load((ROOT / "configs" / f"{dataset.config}.yaml").read_text(encoding="utf-8"))
    for section, keys in changes.items():
        config[section] = {**config.get(section, {}), **keys}
    out.mkdir(parents=True, exist_ok=True)
    path = out.with_suffix(".yaml")
    path.write_text(yaml.safe_dump(config), encoding="utf-8")
    spent = {}
    for stage in stages:
        before = _children()
        command = [sys.executable, "-m", "pipeline", "run", stage, "--config", str(path), "--out", str(out)]
        done = subprocess.run([*command, "--workers", "1"], cwd=ROOT, capture_output=True, text=True, check=False)
        if done.returncode:
            raise RuntimeError(f"stage {stage} of {dataset.config} ended with {done.returncode}: {done.stderr[-2000:]}")
        spent[stage] = _children() - before
    return spent


def _children() -> float:
    """Return the CPU seconds of all finished child processes."""
    times = os.times()
    return times.children_user + times.children_system


def _samples(out: Path) -> int:
    """Return the count of samples of the dataset in a folder."""
    from pyarrow import parquet

    rows: int = parquet.read_metadata(next(out.glob("*-index/*.parquet"))).num_rows
    return rows
