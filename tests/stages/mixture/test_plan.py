"""The plan of a mixture while producers are at different stages of their work."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import yaml

from pipeline.config import Config, load_config
from pipeline.registry import find_stages
from pipeline.stage import Plan
from stages.mixture.stage import plan

PROGRAMS, RANDOM = "toy-train-000000", "toy-random-000000"


@dataclass(frozen=True)
class PartPlan:
    """What a plan sees: shards by stage, and summaries of those that are made, as `stage/shard`."""

    config: Config
    planned: Mapping[str, list[str]]
    made: Mapping[str, Mapping[str, Any]]

    def shards(self, stage: str) -> list[str]:
        return list(self.planned.get(stage, []))

    def summary(self, stage: str, shard: str) -> Mapping[str, Any] | None:
        return self.made.get(f"{stage}/{shard}")


def test_nothing_is_assigned_while_a_producer_is_back_at_its_first_shards(tmp_path: Path) -> None:
    """As after a change of its code: the listings of the other producer are still made."""
    path = tmp_path / "toy.yaml"
    sections = {
        "mixture": True,
        "programs": {"program": "chair"},
        "shapeassembly": {"random": [{"name": "random", "samples": 3}]},
    }
    path.write_text(yaml.safe_dump({"name": "toy", "license": "MIT", **sections}), encoding="utf-8")
    config = load_config(path, {name: stage.config for name, stage in find_stages().items()})
    split = {"split": "train", "samples": 3}
    made = {f"programs/{PROGRAMS}": split, f"mixture/programs-{PROGRAMS}": split}
    planned = {"programs": [PROGRAMS], "shapeassembly": [RANDOM], "mixture": [f"programs-{PROGRAMS}"]}
    before = [shard.name for shard in plan(cast(Plan, PartPlan(config, planned, made)))]
    assert before == [f"programs-{PROGRAMS}"]
    planned = {**planned, "shapeassembly": [RANDOM, "toy-assignment"]}
    after = [shard.name for shard in plan(cast(Plan, PartPlan(config, planned, made)))]
    assert after == [f"programs-{PROGRAMS}", "toy-assignment"]
