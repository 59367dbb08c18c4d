"""Integrity of finished shards: every byte of every file is what its record says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from pipeline.config import Config
from pipeline.inventory import Inventory, StageInventory
from pipeline.paths import DatasetPaths, StagePaths, file_digest, remove
from pipeline.records import ShardRecord, read_record
from pipeline.stage import Stage


def corrupted_shards(config: Config, stages: Mapping[str, Stage], paths: DatasetPaths) -> Iterator[str]:
    """Yield a line for each unfinished stage, each file whose bytes differ from its record, and each published file
    that is missing or altered.

    Removes the record of a corrupted shard, so that the next run rebuilds that shard and restores published files. A
    stage that publishes incomplete results, such as training, does not count as unfinished.
    """
    inventory = Inventory(config, stages, paths)
    for name in stages:
        state = inventory.stage(name)
        missing = [] if state.stage.publishes_incomplete else state.missing
        if missing:
            yield f"{name}: {len(missing)} of {len(state.shards)} shards are not made, first {missing[0].name}"
        for shard, record in state.records.items():
            for file in () if shard in state.pruned else corrupted_files(record, state.paths):
                remove(state.paths.records / f"{shard}.json")
                yield f"{name}: {file} is corrupted; the next run rebuilds {shard}"
        if not missing:
            yield from (f"{name}: {path} is not what the stage made" for path in _altered(state, paths))


def _altered(state: StageInventory, paths: DatasetPaths) -> Iterator[Path]:
    """Yield the published files that are missing, or have other bytes than the stage gave them."""
    for target, file in state.stage.publish(state.view).items():
        path, original = paths.out / target, state.paths.root / file
        recorded = state.records[file.partition(".")[0]].files[file]["sha256"]
        # A link to a file of the shard was checked with the shard.
        linked = path.is_file() and original.is_file() and path.samefile(original)
        if not linked and not (path.is_file() and file_digest(path) == recorded):
            yield path


def corrupted_files(record: ShardRecord, paths: StagePaths) -> list[Path]:
    """Return the files of a shard that are missing or whose bytes differ from its record."""
    digests = {paths.root / file: recorded["sha256"] for file, recorded in record.files.items()}
    return [path for path, digest in digests.items() if not path.is_file() or file_digest(path) != digest]


def withdraw_corrupted(paths: DatasetPaths, source: str) -> bool:
    """Remove the record of `source`, `stage/shard`, if one of its files is corrupted; return whether it was."""
    stage, _, shard = source.partition("/")
    path = paths.stage(stage).records / f"{shard}.json"
    record = read_record(path)
    if record is not None and not corrupted_files(record, paths.stage(stage)):
        return False
    remove(path)
    return True
