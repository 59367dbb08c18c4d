"""What a stage adds to every sample: members beside its mesh, and fields of its record."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from pipeline.config import Config
from pipeline.stage import Plan
from stages.shape.arrays import ByteArray
from stages.shape.views.camera import Camera

TEXT = "txt"
"""The member that every sample has: its text. Of a shape graph a stage adds it; else the sample brings it."""


@dataclass(frozen=True)
class Member:
    """One file of every sample.

    name: what stands after the key, such as `points.npy`; its ending says the format: npy, png, txt, json or glb.
    sentence: what it is, for people; dtype, shape: of an array, a name for each length that differs from sample to
    sample; arrays of one sample that share such a name have the same length there.
    """

    name: str
    sentence: str
    dtype: str = ""
    shape: tuple[int | str, ...] = ()


@dataclass(frozen=True)
class RecordField:
    """One field of a sample's record: its JSON schema, with a `description`."""

    schema: Mapping[str, Any]


@dataclass(frozen=True)
class IndexColumn:
    """A column of the index: its Arrow type, and where in a record its value stands."""

    kind: str
    place: tuple[str, ...]


@dataclass(frozen=True)
class PreviewRow:
    """A row of the preview picture: the same samples as in the first row, drawn from what a stage has made of them.

    title; caption: what is shown, in words; draw: members of one sample, camera and size in pixels -> uint8 picture.
    """

    title: str
    caption: Callable[[Config], str]
    draw: Callable[[Mapping[str, bytes], Camera, int], ByteArray]


def _no_fields(_: Config) -> Mapping[str, RecordField]:
    return {}


def _nothing_to_say(_: Plan) -> Sequence[str]:
    return ()


@dataclass(frozen=True)
class Members:
    """What a stage adds. `MEMBERS = Members(...)` stands in `stages/<stage>/members.py`.

    Its plan is `collection_shards`; each shard has a tar with the declared members of each sample, and a `json`
    with the declared fields, which package merges into the record.

    of: the members, given the config; fields: of the record, by name; columns: of the index, by name.
    row: how the preview shows it, or None; card: paragraphs and tables for the card's section on how the dataset was
    made, from finished records.
    """

    of: Callable[[Config], tuple[Member, ...]]
    fields: Callable[[Config], Mapping[str, RecordField]] = _no_fields
    columns: Mapping[str, IndexColumn] = field(default_factory=dict)
    row: PreviewRow | None = None
    card: Callable[[Plan], Sequence[str]] = _nothing_to_say
