"""The mill's own part of `verify`: every byte of every finished shard is what its record says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from pipeline.config import Config
from pipeline.inventory import Inventory, StageInventory
from pipeline.paths import DatasetPaths, StagePaths, file_digest, remove
from pipeline.records import ShardRecord, read_record
from pipeline.stage import Stage


def corrupted_shards(config: Config, stages: Mapping[str, Stage], places: DatasetPaths) -> Iterator[str]:
    """A line for each stage that is unfinished, for each file whose bytes differ from its record, and for each file in
    the output folder that is not the one that a stage put there. A stage that publishes parts, as training does its
    models, is not unfinished because nobody has asked for some of them.

    The record of a damaged shard is withdrawn, so that the next run makes that shard again and nothing else; it puts
    published files back, too.
    """
    survey = Inventory(config, stages, places)
    for name in stages:
        surveyed = survey.stage(name)
        missing = [] if surveyed.stage.publishes_incomplete else surveyed.missing
        if missing:
            yield f"{name}: {len(missing)} of {len(surveyed.shards)} shards are not made, first {missing[0].name}"
        for shard, record in surveyed.records.items():
            for file in () if shard in surveyed.pruned else corrupted_files(record, surveyed.paths):
                remove(surveyed.paths.records / f"{shard}.json")
                yield f"{name}: {file} is damaged; the next run makes {shard} again"
        if not missing:
            yield from (f"{name}: {path} is not what the stage made" for path in _altered(surveyed, places))


def _altered(surveyed: StageInventory, places: DatasetPaths) -> Iterator[Path]:
    """The published files that are gone, or have other bytes than the stage gave them."""
    for target, file in surveyed.stage.publish(surveyed.view).items():
        path, made = places.out / target, surveyed.paths.root / file
        noted = surveyed.records[file.partition(".")[0]].files[file]["sha256"]
        # what is linked has been looked at as a file of the shard
        if not path.is_file() or not ((made.is_file() and path.samefile(made)) or file_digest(path) == noted):
            yield path


def corrupted_files(record: ShardRecord, places: StagePaths) -> list[Path]:
    """The files of a shard whose bytes are not what its record says, or that are gone."""
    paths = {places.root / file: noted["sha256"] for file, noted in record.files.items()}
    return [path for path, digest in paths.items() if not path.is_file() or file_digest(path) != digest]


def withdraw_corrupted(places: DatasetPaths, source: str) -> bool:
    """Take away the record of `source`, `stage/shard`, if its files are not what it says; tell whether it was so."""
    stage, _, shard = source.partition("/")
    path = places.stage(stage).records / f"{shard}.json"
    record = read_record(path)
    if record is not None and not corrupted_files(record, places.stage(stage)):
        return False
    remove(path)
    return True
