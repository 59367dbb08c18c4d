"""Toy stages: `run_toy_stages` runs them, and `python -m tests.pipeline.toy_run` is their command line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pipeline.cli import main
from pipeline.config import Config, load_config
from pipeline.paths import DatasetPaths
from pipeline.registry import find_stages
from pipeline.run import RunResult, run_stages
from pipeline.slices import WHOLE, Slice

PACKAGE = "tests.pipeline.toy_stages"
STAGES = find_stages(PACKAGE)


def load(config: Path) -> Config:
    """The config in a file, with the sections of the test stages."""
    return load_config(config, {name: stage.config for name, stage in STAGES.items()})


def run_toy_stages(
    config: Path, out: Path, *stages: str, workers: int = 1, part: Slice = WHOLE, **how: Any
) -> dict[str, RunResult]:
    """Run `stages` (all of them, if none is named) in order, in this process and its workers."""
    loaded = load(config)
    places = DatasetPaths(out, loaded.name)
    return run_stages(stages or STAGES, STAGES, loaded, places, workers, part=part, **how)


if __name__ == "__main__":
    main(PACKAGE)
