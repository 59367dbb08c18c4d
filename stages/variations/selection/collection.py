"""The collection: the samples of a shard, written from what the searches found."""

from __future__ import annotations

import json
from collections import Counter
from typing import Any

import numpy as np

from pipeline.shards import ShardWriter
from pipeline.stage import Outcome, Task
from stages.exemplars.settings import ExemplarsConfig
from stages.rows.changes import changes_text
from stages.shape.collection.assignment import SPLITS
from stages.shape.graphs.canonical import graph_digest
from stages.shape.sample import Sample, write_sample
from stages.variations.requirements.hub_restoration import HubRestorer, hub_restorer
from stages.variations.search.pool import FoundVariants
from stages.variations.selection.assignment import sample_key
from stages.variations.selection.orientation import OrientationFix


def run_collection(task: Task) -> Outcome:
    """Write the samples of one shard."""
    assignment = f"{task.config.name}-assignment"
    rows = np.load(task.input("variations", f"{assignment}.rows.npy"), allow_pickle=False)
    parents = task.input("variations", f"{assignment}.parents.jsonl").read_bytes().splitlines()
    searches = task.input("variations", f"{assignment}.searches.txt").read_text(encoding="utf-8").splitlines()
    kits = [kit.name for kit in task.config.section(ExemplarsConfig).kits]
    split: str = task.shard.params["split"]
    mine = np.flatnonzero((rows[:, 4] == SPLITS.index(split)) & (rows[:, 5] == task.shard.params["number"]))
    found: dict[int, FoundVariants] = {}
    orientations: dict[str, OrientationFix] = {}
    counts: Counter[str] = Counter()
    with task.output(f"{task.shard.name}.tar") as stream, ShardWriter(stream) as writer:
        for row in mine.tolist():
            kit_number, search, index, number = rows[row, :4].tolist()
            kit = kits[kit_number]
            if search not in found:
                found[search] = FoundVariants.of(task, searches[search])
            restorer = hub_restorer(task, kit)
            if kit not in orientations:
                orientations[kit] = OrientationFix(restorer.kit)
            named = json.loads(parents[row])
            write_sample(writer, _sample(restorer, orientations[kit], number, split, found[search], index, named))
            counts[kit] += 1
    summary: dict[str, Any] = {"split": split, "samples": len(mine), "kits": dict(sorted(counts.items()))}
    return Outcome(len(mine), summary)


def _sample(
    restorer: HubRestorer,
    orientation: OrientationFix,
    number: int,
    split: str,
    found: FoundVariants,
    index: int,
    parents: list[str],
) -> Sample:
    """Return one variant with its hubs restored, oriented as the exemplars are.

    Equal graphs with hubs are equal without them, so hubs never take a graph into another split. The lineage names as
    `parents` samples of its own split and exemplars, and as `made_of` what the variant was put together from:
    exemplars, or variants by the `name` that each has in the search.
    """
    bare, _ = found.assembly(index)
    assembly = restorer.fit(bare)
    degrees = orientation.turn(assembly)
    kit, added = restorer.kit.name, len(assembly) - len(bare)
    described = found.described(index)
    return Sample(
        key=sample_key(kit, number),
        split=split,
        producer="variations",
        kit=kit,
        graph=graph_digest(restorer.kit.label_of[assembly.types], assembly.edges) if added else found.digest(index),
        assembly=orientation.turned_back(assembly, degrees),
        lineage={
            "method": described["method"],
            "name": found.name_of(index),
            **described,
            "parents": parents,
            "made_of": described["parents"],
            "rows": described.get("rows", changes_text(())),
            "restored_hubs": added,
            "turned_degrees": round(-degrees % 360, 6),
        },
    )
