"""Large datasets in the engine: plans, records and `make status`, without samples."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
import yaml

from pipeline.config import Config, load_config
from pipeline.inventory import Inventory, StageInventory
from pipeline.paths import DatasetPaths
from pipeline.records import ShardRecord
from pipeline.registry import find_stages
from pipeline.stage import Shard, Stage
from pipeline.status import status_lines
from pipeline.trial import short_config

STAGES = ("programs", "points", "sketches", "validity", "package")


def dataset_of(samples: int, folder: Path) -> tuple[Config, Mapping[str, Stage]]:
    """Return the config of a dataset with that many chairs."""
    path, stages = folder / "big.yaml", find_stages()
    programs = {"program": "chair", "mode": "random", "random": {"samples": samples}}
    path.write_text(yaml.safe_dump({"name": "big", "programs": programs}), encoding="utf-8")
    return load_config(path, {name: stage.config for name, stage in stages.items()}), stages


def finish(surveyed: StageInventory) -> int:
    """Write the records of all shards that are planned and have none; how many these are."""
    surveyed.paths.make()
    for shard in surveyed.missing:
        (surveyed.paths.records / f"{shard.name}.json").write_bytes(record_of(surveyed, shard).to_bytes())
    return len(surveyed.missing)


def record_of(surveyed: StageInventory, shard: Shard) -> ShardRecord:
    samples, split = int(shard.params.get("samples", 0)), shard.params.get("split")
    rows: dict[str, Any] = {
        "split": split,
        "samples": samples,
        "tried": samples,
        "renderer": "none",
        "renderer_version": "none",
    }
    rows |= {"rooted": samples, "stable": samples, "path": f"{shard.name}.tar", "members": ["glb"], "bytes": 1}
    rows["kits"] = {"chair": samples}
    return ShardRecord(
        stage=surveyed.stage.name,
        shard=shard.name,
        fingerprint=surveyed.fingerprints[shard.name],
        recipe=surveyed.recipes[shard.name],
        inputs={},
        files={},
        samples=samples,
        rejects={},
        seconds=1.0,
        peak_bytes=1,
        summary=rows,
    )


@pytest.mark.slow
def test_status_of_a_hundred_thousand_samples_is_read_from_records_in_seconds(tmp_path: Path) -> None:
    config, stages = dataset_of(100_000, tmp_path)
    places = DatasetPaths(tmp_path, config.name)
    inventory = Inventory(config, stages, places)
    for name in STAGES:
        while finish(inventory.stage(name)):
            inventory.refresh(name)
    start = time.process_time()
    rows = {line.split()[0]: line.split() for line in status_lines(config, stages, places, 1)}
    assert time.process_time() - start < 5
    assert {name: rows[name][3] for name in STAGES} == dict.fromkeys(STAGES, "100,000")
    assert rows["points"][1] == "197/197"


def test_a_trial_of_a_million_shapes_plans_no_more_shards_than_the_run(tmp_path: Path) -> None:
    config, stages = dataset_of(1_000_000, tmp_path)
    tried = stages["programs"].requested_samples(short_config(config, stages))
    assert len(tried) == len(stages["programs"].requested_samples(config)) == 1955
    assert max(tried) <= 8
