"""One shard of the dataset: what the stages made of each sample, put together under the sample's key."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, BinaryIO, cast

from pipeline.errors import ShardFailed
from pipeline.shards import ShardWriter, json_bytes, read_shard
from pipeline.stage import Outcome, Task
from stages.package.glb import glb_bytes
from stages.package.layout import shard_path
from stages.package.record import describe_sample, rounded
from stages.shape.collection.shapes import Collection
from stages.shape.collection.shards import KIT_PRODUCER
from stages.shape.sample import Sample
from stages.sketches.settings import SketchesConfig

__all__ = ["merge_shard", "merged_stages"]

TEXT = "txt"


def merged_stages(producer: str) -> tuple[str, ...]:
    """The stages whose members a sample of this producer gets, in this order; the `json` of validity and points
    goes into the sample's own. What is not made of kits brings its own text."""
    stages = ("validity", "points", "sketches")
    return (*stages, "strings") if producer == KIT_PRODUCER else stages


def merge_shard(task: Task) -> Outcome:
    """Files of the shard: `.tar`, the dataset's, and `.jsonl`, its rows of the index.

    A sample that one of the stages has refused is left out and counted. Raises ShardFailed where samples differ in
    their members.
    """
    config, split = task.config, str(task.shard.params["split"])
    path = shard_path(config, split, int(task.shard.name.rpartition("-")[2]))
    views = [view.name for view in config.section(SketchesConfig).views]
    collection = Collection(task)
    total, rows = int(task.shard.params["samples"]), []
    members_of_all: list[str] = []
    counts: Counter[str] = Counter()
    with task.output(f"{task.shard.name}.tar") as file:
        stream = HashingStream(file)
        with ShardWriter(cast(BinaryIO, stream)) as writer:
            for sample, made in _samples(task, collection):
                shape = collection.shape(sample)
                shape = replace(shape, assembly=replace(shape.assembly, poses=rounded(shape.assembly.poses)))
                judged = json.loads(made["validity"].pop("json"))
                points = json.loads(made["points"].pop("json"))
                members = {"glb": glb_bytes(shape)}
                for stage_members in made.values():
                    members.update(stage_members)
                members.setdefault(TEXT, sample.text.encode())
                text = sample.text or members[TEXT].decode().split("\n", 1)[0]
                record = describe_sample(sample, shape, text, judged, points, views)
                members["json"] = json_bytes(record)
                if members_of_all and list(members) != members_of_all:
                    raise ShardFailed(f"{sample.key} has members {list(members)}, others have {members_of_all}")
                members_of_all = list(members)
                writer.write(sample.key, members)
                counts[sample.kit] += 1
                rows.append(_row(record, path, writer.offsets[sample.key], members))
                task.progress(writer.samples, total)
    with task.output(f"{task.shard.name}.jsonl") as listing:
        listing.writelines(json_bytes(row) for row in rows)
    summary = {
        "path": path,
        "split": split,
        "samples": writer.samples,
        "bytes": stream.written,
        "sha256": stream.digest(),
        "members": members_of_all,
        "kits": dict(counts),
    }
    return Outcome(samples=writer.samples, summary=summary)


class HashingStream:
    """What a tar is written to: passes all on to `stream`, and knows its length and SHA-256."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._hash = hashlib.sha256()
        self.written = 0

    def write(self, content: bytes) -> int:
        """Write all of `content`."""
        self._hash.update(content)
        self.written += len(content)
        return self._stream.write(content)

    def tell(self) -> int:
        """How many bytes have been written."""
        return self.written

    def digest(self) -> str:
        """SHA-256 of what has been written, in hexadecimal."""
        return self._hash.hexdigest()


def _samples(task: Task, collection: Collection) -> Iterator[tuple[Sample, dict[str, dict[str, bytes]]]]:
    """Each sample with what each stage made of it. The stages keep the order of the collection, with gaps."""
    name = f"{task.shard.name}.tar"
    readers = {stage: read_shard(task.input(stage, name)) for stage in merged_stages(collection.producer)}
    heads = {stage: next(reader, None) for stage, reader in readers.items()}
    for sample in collection.samples():
        made: dict[str, dict[str, bytes]] = {}
        for stage, reader in readers.items():
            head = heads[stage]
            if head is not None and head[0] == sample.key:
                made[stage] = head[1]
                heads[stage] = next(reader, None)
        missing = [stage for stage in readers if stage not in made]
        if missing:
            task.reject(sample.key, f"refused by {missing[0]}")
        else:
            yield sample, made
    left = [f"{head[0]} of {stage}" for stage, head in heads.items() if head is not None]
    if left:
        raise ShardFailed(f"no sample of the collection has this key: {', '.join(left)}")


def _row(record: Mapping[str, Any], path: str, offset: int, members: Mapping[str, bytes]) -> dict[str, Any]:
    """The sample's row in the index. From `offset` on, `bytes` bytes of the shard are the sample, tar headers too."""
    sizes = (512 + (len(content) + 511) // 512 * 512 for content in members.values())
    return {
        "key": record["key"],
        "split": record["split"],
        "kit": record["kit"],
        "graph": record["graph"],
        "producer": record["producer"],
        "shard": path,
        "offset": offset,
        "bytes": sum(sizes),
        **record["counts"],
        **{name: record["physics"][name] for name in ("rooted", "stable", "margin")},
        "text": record["text"],
    }
