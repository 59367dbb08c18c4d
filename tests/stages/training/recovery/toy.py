"""Recovery of stools: the real stage, a tiny network."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from pipeline.config import Config
from pipeline.paths import DatasetPaths
from pipeline.run import RunResult, run_stage
from pipeline.shards import json_bytes
from stages.exemplars.settings import ExemplarsConfig
from stages.programs.settings import ProgramsConfig
from stages.sketches.settings import SketchesConfig
from stages.strings.settings import StringsConfig
from stages.training.settings import TrainingConfig
from stages.training.stage import STAGE
from tests.stages.training.toy_training import STAGES

PROGRAM = "tests.stages.programs.stool"

SMALL: Mapping[str, Any] = {
    "kind": "recovery", "name": "small", "points": 64, "neighbors": 6, "widths": [8, 8], "embedding": 8,
    "channels": [2, 2, 4, 4, 4, 4, 4, 4], "decoder": [16, 8],
    "batch_size": 8, "steps": 6, "max_rounds": 2, "validation_shapes": 6, "shapes_per_round": 6, "augmented_share": 0.5,
}  # fmt: skip


def config(program: str = PROGRAM, **changes: Any) -> Config:
    """A config with one model like SMALL and a dataset of `program`."""
    training = TrainingConfig.model_validate_json(json_bytes({"models": [{**SMALL, **changes}]}))
    sections = {
        "exemplars": ExemplarsConfig(),
        "strings": StringsConfig(),
        "programs": ProgramsConfig(program=program),
        "sketches": SketchesConfig(),
        "training": training,
    }
    return Config("stools", "1.0.0", 3, sections, Path("stools.yaml"), license="CC0-1.0")


def train(wanted: Config, out: Path, workers: int = 1) -> RunResult:
    """Run the stage `training`; there are no kits."""
    STAGE.check(wanted)
    stages = {name: replace(stage, plan=lambda _: []) for name, stage in STAGES.items() if name != "training"}
    return run_stage(
        "training", {**stages, "training": STAGES["training"]}, wanted, DatasetPaths(out, wanted.name), workers
    )
