"""One shard of the dataset: the members of all stages, merged by sample."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, BinaryIO, cast

from pipeline.errors import ShardFailed
from pipeline.shards import ShardWriter, json_bytes, read_shard
from pipeline.stage import Outcome, Task
from stages.package.classes import ClassTally
from stages.package.glb import glb_bytes
from stages.package.hashing import HashingStream
from stages.package.index import index_row, tar_bytes
from stages.package.layout import shard_path
from stages.package.record import describe_sample
from stages.shape.collection.collection import Collection
from stages.shape.collection.discovery import language_of
from stages.shape.collection.members import TEXT
from stages.shape.geometry.pose import rounded
from stages.shape.sample import Sample

NO_STRINGS = b"no text: strings are turned off\n"
"""The text of a sample with a shape graph, where other samples have a text and strings are turned off."""


def merge_shard(task: Task) -> Outcome:
    """Write the dataset's shard `.tar`, its rows of the index `.jsonl`, and its class counts `.classes.json`.

    The param `stages` names the stages that add members; their member `json` holds the fields that they add to the
    record. Samples that a stage refused are left out and counted. Raises ShardFailed where samples have different
    members.
    """
    split = str(task.shard.params["split"])
    path = shard_path(task.config, split, int(task.shard.name.rpartition("-")[2]))
    collection = Collection(task)
    total, rows = int(task.shard.params["samples"]), []
    member_names: list[str] = []
    kits: Counter[str] = Counter()
    makers: Counter[str] = Counter()
    tally, joined = ClassTally(), "joined" in task.shard.params
    with task.output(f"{task.shard.name}.tar") as file:
        stream = HashingStream(file)
        with ShardWriter(cast(BinaryIO, stream)) as writer:
            for sample, added, fields in _samples(task, collection, task.shard.params["stages"]):
                shape = collection.shape(sample)
                shape = replace(shape, assembly=replace(shape.assembly, poses=rounded(shape.assembly.poses)))
                members = {"glb": glb_bytes(shape, fields.get("hierarchy"))}
                if sample.text or TEXT in added or joined:
                    members[TEXT] = sample.text.encode() or NO_STRINGS
                members |= added
                language = language_of(sample.producer).name
                record = describe_sample(sample, language, shape, members, fields, joined)
                members["json"] = json_bytes(record)
                if member_names and list(members) != member_names:
                    raise ShardFailed(f"{sample.key} has members {list(members)}, others have {member_names}")
                member_names = list(members)
                writer.write(sample.key, members)
                kits[sample.kit] += 1
                makers[sample.producer] += 1
                tally.add(shape)
                rows.append(index_row(record, path, writer.offsets[sample.key], tar_bytes(members)))
                task.progress(writer.samples, total)
    with task.output(f"{task.shard.name}.jsonl") as listing:
        listing.writelines(json_bytes(row) for row in rows)
    with task.output(f"{task.shard.name}.classes.json") as class_counts:
        class_counts.write(json_bytes(tally.counts()))
    summary = {
        "path": path,
        "split": split,
        "samples": writer.samples,
        "bytes": stream.written,
        "sha256": stream.digest(),
        "members": member_names,
        "kits": dict(kits),
        "producers": dict(makers),
    }
    return Outcome(samples=writer.samples, summary=summary)


def _samples(
    task: Task, collection: Collection, stages: Sequence[str]
) -> Iterator[tuple[Sample, dict[str, bytes], dict[str, Any]]]:
    """Yield each sample with the members and fields that stages add, in the order of the collection, with gaps."""
    readers = {stage: read_shard(task.input(stage, f"{task.shard.name}.tar")) for stage in stages}
    heads = {stage: next(reader, None) for stage, reader in readers.items()}
    for sample in collection.samples():
        added_by_stage: dict[str, dict[str, bytes]] = {}
        for stage, reader in readers.items():
            head = heads[stage]
            if head is not None and head[0] == sample.key:
                added_by_stage[stage] = head[1]
                heads[stage] = next(reader, None)
        missing = [stage for stage in readers if stage not in added_by_stage]
        if missing:
            task.reject(sample.key, f"refused by {missing[0]}")
        else:
            yield sample, *_merged(sample.key, added_by_stage)
    left = [f"{head[0]} of {stage}" for stage, head in heads.items() if head is not None]
    if left:
        raise ShardFailed(f"no sample of the collection has this key: {', '.join(left)}")


def _merged(key: str, added_by_stage: Mapping[str, dict[str, bytes]]) -> tuple[dict[str, bytes], dict[str, Any]]:
    """Merge members and fields of all stages. Raises ShardFailed where two stages add the same."""
    members: dict[str, bytes] = {}
    fields: dict[str, Any] = {}
    for stage, added in added_by_stage.items():
        own = json.loads(added.pop("json", b"{}"))
        twice = [*(members.keys() & added.keys()), *(fields.keys() & own.keys())]
        if twice:
            raise ShardFailed(f"stage {stage} adds {', '.join(sorted(twice))} to {key}, which another stage adds too")
        members.update(added)
        fields.update(own)
    return members, fields
