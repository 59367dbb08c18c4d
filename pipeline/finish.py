"""The end of a stage: what is no longer planned goes away, what is for users is put in place, then the manifest."""

from __future__ import annotations

import os
import shutil
from collections import Counter
from pathlib import Path

from pipeline.inventory import Inventory, StageInventory
from pipeline.paths import DatasetPaths, file_digest, read_json, remove, sync_folder, temporary_path, write_atomically
from pipeline.shards import json_bytes


def finish_stage(survey: Inventory, name: str, places: DatasetPaths) -> None:
    """Close a stage whose every planned shard is done; done again, it changes nothing.

    Raises ValueError when `publish` names a path outside the output folder or a file that no shard has.
    """
    surveyed = survey.stage(name)
    _forget_unplanned(surveyed)
    rejects: Counter[str] = Counter()
    for record in surveyed.records.values():
        rejects.update(record.rejects)
    publish(surveyed, places)
    manifest = json_bytes(
        {
            "stage": name,
            "dataset": survey.config.name,
            "version": survey.config.version,
            "seed": survey.config.seed,
            "samples": sum(record.samples for record in surveyed.records.values()),
            "rejects": dict(rejects),
            "code": surveyed.code,
            "shards": surveyed.fingerprints,
        }
    )
    if not surveyed.paths.manifest.is_file() or surveyed.paths.manifest.read_bytes() != manifest:
        _write(surveyed.paths.manifest, manifest)


def publish(surveyed: StageInventory, places: DatasetPaths) -> None:
    """Bring the output folder to what the stage publishes, and take away what it published before and no more.

    Raises ValueError when that is a path outside the output folder or a file that no finished shard has.
    """
    wanted = {_inside(target): file for target, file in sorted(surveyed.stage.publish(surveyed.view).items())}
    listing = surveyed.paths.published
    before = _listed(listing)
    gone = [target for target in before if target not in wanted]
    if set(before) != set(wanted):
        # Everything that may lie there is listed before it does, so that no kill leaves a file nobody knows of.
        _write(listing, json_bytes(sorted(str(each) for each in {*before, *wanted})))
    for target, file in wanted.items():
        record = surveyed.records.get(file.partition(".")[0])
        if record is None or file not in record.files:
            raise ValueError(f"stage {surveyed.stage.name} publishes {file!r}, which is no file of its shards")
        _put(surveyed.paths.root / file, places.out / target, record.files[file]["sha256"])
    for target in gone:
        _take_away(places.out, target)
    if gone:
        _write(listing, json_bytes(sorted(str(each) for each in wanted)))


def _forget_unplanned(surveyed: StageInventory) -> None:
    places, planned = surveyed.paths, surveyed.fingerprints
    # Records first: a record without its files is a shard to be made, files without a record are nothing.
    for folder in (places.records, places.root, places.rejects, places.failed, places.progress):
        for path in folder.iterdir():
            if path.is_file() and path.name.lstrip(".").partition(".")[0] not in planned:
                path.unlink(missing_ok=True)


def _listed(listing: Path) -> list[Path]:
    """What the stage has published before; nothing where that cannot be read any more, and nobody knows of it then."""
    try:
        return [_inside(each) for each in read_json(listing)]
    except (ValueError, TypeError):
        return []


def _write(path: Path, content: bytes) -> None:
    if path.is_dir():
        remove(path)
    write_atomically(path, content)


def _inside(target: str) -> Path:
    path = Path(target)
    if path.is_absolute() or ".." in path.parts or not path.parts or path.parts[0] == ".work":
        raise ValueError(f"published path {target!r} must lie inside the output folder")
    return path


def _put(source: Path, target: Path, digest: str) -> None:
    if target.is_file() and (source.samefile(target) or file_digest(target) == digest):
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    beside = temporary_path(target)
    beside.unlink(missing_ok=True)
    try:
        os.link(source, beside)
    except OSError:  # a disk without links; when it is full instead, the copy says so
        with open(source, "rb") as stream, open(beside, "wb") as copy:
            shutil.copyfileobj(stream, copy)
            copy.flush()
            os.fsync(copy.fileno())
    os.replace(beside, target)
    sync_folder(target.parent)


def _take_away(out: Path, target: Path) -> None:
    (out / target).unlink(missing_ok=True)
    for folder in target.parents:
        if folder != Path(".") and (out / folder).is_dir() and not any((out / folder).iterdir()):
            (out / folder).rmdir()
