"""What lies between exemplars and dataset, taken away when the dataset is finished, where its config says so.

Files go, records stay and count: a note in the stage's own folder, written before the first file goes, says of which
records the files were let go of, each by its seal. Where a shard is to be made of them after all, they are found gone
like any damaged input, and made again first.
"""

from __future__ import annotations

from collections.abc import Mapping

from pipeline.inventory import Inventory, StageInventory
from pipeline.paths import StagePaths, read_json, remove, write_atomically
from pipeline.registry import upstream
from pipeline.shards import json_bytes
from pipeline.stage import Stage


def prune_inputs(survey: Inventory, stages: Mapping[str, Stage], name: str) -> int:
    """Take away the files of all shards that the finished stage `name` reads, directly or not; the bytes that this
    frees. Files that a stage publishes stay, and those of stages that other commands look at (`Stage.stays`)."""
    freed = 0
    for each in upstream(stages, name):
        if each != name and not stages[each].keep_output:
            freed += _let_go_of_stage(survey.stage(each))
    return freed


def _let_go_of_stage(surveyed: StageInventory) -> int:
    published = set(surveyed.stage.publish(surveyed.view).values())
    unneeded = {name: each for name, each in surveyed.records.items() if published.isdisjoint(each.files)}
    paths = [surveyed.paths.root / file for record in unneeded.values() for file in record.files]
    there = [path for path in paths if path.exists()]
    if there:
        _note(surveyed.paths, {name: each.checksum() for name, each in unneeded.items()})
    freed = sum(path.stat().st_size for path in there)
    for path in there:
        remove(path)
    return freed


def _note(places: StagePaths, seals: Mapping[str, str]) -> None:
    if read_json(places.pruned) != seals:
        write_atomically(places.pruned, json_bytes(seals))
