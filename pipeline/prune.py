"""Pruning: delete intermediate files when the dataset is finished, where its config says `keep: dataset`.

Records stay and count. A listing in the stage's folder, written before the first file is deleted, holds the checksums
of the records whose files were pruned. A shard that needs such files later finds them missing, like any corrupted
input, and the engine rebuilds them first.
"""

from __future__ import annotations

from collections.abc import Mapping

from pipeline.inventory import Inventory, StageInventory
from pipeline.paths import read_json, remove, write_atomically
from pipeline.registry import upstream
from pipeline.shards import json_bytes
from pipeline.stage import Stage


def prune_inputs(inventory: Inventory, stages: Mapping[str, Stage], name: str) -> int:
    """Delete the files of all shards upstream of the finished stage `name`; return the number of bytes freed.

    Published files stay, and those of stages with `keep_output`, which other commands read.
    """
    pruned = [read for read in upstream(stages, name) if read != name and not stages[read].keep_output]
    return sum(_prune_stage(inventory.stage(read)) for read in pruned)


def _prune_stage(state: StageInventory) -> int:
    published = set(state.stage.publish(state.view).values())
    unneeded = {name: record for name, record in state.records.items() if published.isdisjoint(record.files)}
    files = [state.paths.root / file for record in unneeded.values() for file in record.files]
    existing = [path for path in files if path.exists()]
    checksums = {name: record.checksum() for name, record in unneeded.items()}
    if existing and read_json(state.paths.pruned) != checksums:
        write_atomically(state.paths.pruned, json_bytes(checksums))
    freed = sum(path.stat().st_size for path in existing)
    for path in existing:
        remove(path)
    return freed
