"""The end of a stage: delete unplanned files, publish results, then write the manifest."""

from __future__ import annotations

import os
import shutil
from collections import Counter
from pathlib import Path

from pipeline.inventory import Inventory, StageInventory
from pipeline.paths import DatasetPaths, file_digest, read_json, remove, sync_folder, temporary_path, write_atomically
from pipeline.shards import json_bytes


def finish_stage(inventory: Inventory, name: str, paths: DatasetPaths) -> None:
    """Close a stage whose every planned shard is done; idempotent.

    Raises ValueError when `publish` names a path outside the output folder or a file that no shard has.
    """
    state = inventory.stage(name)
    _delete_unplanned(state)
    rejects: Counter[str] = Counter()
    for record in state.records.values():
        rejects.update(record.rejects)
    publish(state, paths)
    manifest = json_bytes(
        {
            "stage": name,
            "dataset": inventory.config.name,
            "version": inventory.config.version,
            "seed": inventory.config.seed,
            "samples": sum(record.samples for record in state.records.values()),
            "rejects": dict(rejects),
            "code": state.code,
            "shards": state.fingerprints,
        }
    )
    if not state.paths.manifest.is_file() or state.paths.manifest.read_bytes() != manifest:
        _write(state.paths.manifest, manifest)


def publish(state: StageInventory, paths: DatasetPaths) -> None:
    """Put what the stage publishes into the output folder, and remove what it published before.

    Raises ValueError when `publish` names a path outside the output folder or a file that no finished shard has.
    """
    wanted = {_inside(target): file for target, file in sorted(state.stage.publish(state.view).items())}
    listing = state.paths.published
    before = _listed(listing)
    unpublished = [target for target in before if target not in wanted]
    if set(before) != set(wanted):
        # Files are listed before they are written, so that a kill leaves none that is not listed.
        _write(listing, json_bytes(sorted(map(str, {*before, *wanted}))))
    for target, file in wanted.items():
        record = state.records.get(file.partition(".")[0])
        if record is None or file not in record.files:
            raise ValueError(f"stage {state.stage.name} publishes {file!r}, which is no file of its shards")
        _put(state.paths.root / file, paths.out / target, record.files[file]["sha256"])
    for target in unpublished:
        _unpublish(paths.out, target)
    if unpublished:
        _write(listing, json_bytes(sorted(map(str, wanted))))


def _delete_unplanned(state: StageInventory) -> None:
    paths, planned = state.paths, state.fingerprints
    # Records first: a record without its files is a shard to make, files without a record are nothing.
    for folder in (paths.records, paths.root, paths.rejects, paths.failed, paths.progress):
        for path in folder.iterdir():
            if path.is_file() and path.name.lstrip(".").partition(".")[0] not in planned:
                path.unlink(missing_ok=True)


def _listed(listing: Path) -> list[Path]:
    """Return what the stage published before; nothing where the listing is missing or corrupted."""
    try:
        return [_inside(target) for target in read_json(listing)]
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
    temporary = temporary_path(target)
    temporary.unlink(missing_ok=True)
    try:
        os.link(source, temporary)
    except OSError:  # no links on this disk; if it is full instead, the copy raises
        with open(source, "rb") as stream, open(temporary, "wb") as copy:
            shutil.copyfileobj(stream, copy)
            copy.flush()
            os.fsync(copy.fileno())
    os.replace(temporary, target)
    sync_folder(target.parent)


def _unpublish(out: Path, target: Path) -> None:
    (out / target).unlink(missing_ok=True)
    for folder in target.parents:
        if folder != Path(".") and (out / folder).is_dir() and not any((out / folder).iterdir()):
            (out / folder).rmdir()
