"""A sample: one shape of a collection, whatever made it, and its way to and from a shard."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pipeline.shards import ShardWriter, array_bytes, bytes_array, json_bytes, read_shard
from stages.shape.kit import EMPTY_ASSEMBLY, Assembly


@dataclass(frozen=True)
class Sample:
    """One shape.

    key: unique in its dataset, without a dot
    split: `train`, `val` or `test`
    producer: stage that made it
    kit: kit of its assembly, or program or category of its text
    graph: hex digest of its structure; for a kit that of its canonical coloured shape graph (equal exactly for
        isomorphic graphs of one kit), for a program that of its discrete parameters
    lineage: JSON on how it was made: `method` (default: the producer's name), `parents` it was made from (keys of
        samples, names of exemplars or files; default: `kit`), and the fields that its producer declares
    assembly: its parts, for a kit
    text: text from which its producer makes the shape (a program, its parameters); empty for a kit
    """

    key: str
    split: str
    producer: str
    kit: str
    graph: str
    lineage: Mapping[str, Any]
    assembly: Assembly = field(default_factory=lambda: EMPTY_ASSEMBLY)
    text: str = ""


def write_sample(writer: ShardWriter, sample: Sample) -> None:
    """Append `sample` to a shard as `json`, `types.npy`, `poses.npy`, `edges.npy` and, if parts are stretched,
    `stretches.npy`.
    """
    fields = {
        "key": sample.key,
        "split": sample.split,
        "producer": sample.producer,
        "kit": sample.kit,
        "graph": sample.graph,
        "lineage": dict(sample.lineage),
        "text": sample.text,
    }
    members = {
        "json": json_bytes(fields),
        "types.npy": array_bytes(sample.assembly.types),
        "poses.npy": array_bytes(sample.assembly.poses),
        "edges.npy": array_bytes(sample.assembly.edges),
    }
    if sample.assembly.stretches is not None:
        members["stretches.npy"] = array_bytes(sample.assembly.stretches)
    writer.write(sample.key, members)


def read_samples(path: Path) -> Iterator[Sample]:
    """Yield the samples of a shard that `write_sample` made, in order, one in memory at a time."""
    for _, members in read_shard(path):
        assembly = Assembly(
            types=bytes_array(members["types.npy"]),
            poses=bytes_array(members["poses.npy"]),
            edges=bytes_array(members["edges.npy"]),
            stretches=bytes_array(members["stretches.npy"]) if "stretches.npy" in members else None,
        )
        yield Sample(assembly=assembly, **json.loads(members["json"]))
