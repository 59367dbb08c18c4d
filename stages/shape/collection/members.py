"""What a stage adds to every sample: members and fields of its record."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from pipeline.config import Config
from pipeline.stage import Plan
from stages.shape.arrays import ByteArray
from stages.shape.views.camera import Camera

TEXT = "txt"
"""The member that every sample has: its text. A shape graph gets it from a stage; other samples bring it."""


@dataclass(frozen=True)
class Member:
    """One file of every sample.

    name: what follows the key, such as `points.npy`; the suffix is the format: npy, png, jpg, webp, exr, txt, json, glb
    sentence: description for people
    dtype: dtype of an array
    shape: shape of an array, with a name for each length that differs between samples; arrays of one sample that share
        a name have the same length there
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
    """A column of the index.

    kind: Arrow type
    place: path of the value in a record
    """

    kind: str
    place: tuple[str, ...]


@dataclass(frozen=True)
class PreviewRow:
    """A row of the preview picture: the samples of the first row, drawn from what a stage made of them.

    title: heading of the row
    caption: function that says in words what is shown
    draw: function of the members of a sample, a camera and a size in pixels that returns a uint8 picture
    """

    title: str
    caption: Callable[[Config], str]
    draw: Callable[[Mapping[str, bytes], Camera, int], ByteArray]


def _no_fields(_: Config) -> Mapping[str, RecordField]:
    return {}


def _no_rows(_: Config) -> Sequence[PreviewRow]:
    return ()


def _nothing_of(_: Config) -> Sequence[str]:
    return ()


def _nothing_to_say(_: Plan) -> Sequence[str]:
    return ()


@dataclass(frozen=True)
class Members:
    """What a stage adds, declared as `MEMBERS = Members(...)` in `stages/<stage>/members.py`.

    The plan of the stage is `collection_shards`. Each shard has a tar with the declared members of each sample, and a
    `json` with the declared fields, which packaging merges into the record.

    of: function of the config that returns the members
    fields: function of the config that returns the fields of the record by name
    columns: columns of the index by name
    rows: function of the config that returns the rows of the preview
    card: paragraphs and tables for the card's section on how the dataset was made, from finished records
    limits: sentences on what not to expect of the members, for the card of a config
    coordinates: sentences on the coordinates of the members, for the card of a config
    checks: what only `make verify` checks of the members, for the card
    tasks: Hugging Face task categories that the members serve, for the card of a config
    """

    of: Callable[[Config], tuple[Member, ...]]
    fields: Callable[[Config], Mapping[str, RecordField]] = _no_fields
    columns: Mapping[str, IndexColumn] = field(default_factory=dict)
    rows: Callable[[Config], Sequence[PreviewRow]] = _no_rows
    card: Callable[[Plan], Sequence[str]] = _nothing_to_say
    limits: Callable[[Config], Sequence[str]] = _nothing_of
    coordinates: Callable[[Config], Sequence[str]] = _nothing_of
    checks: tuple[str, ...] = ()
    tasks: Callable[[Config], Sequence[str]] = _nothing_of


def object_schema(description: str, properties: Mapping[str, Any]) -> dict[str, Any]:
    """Return the JSON schema of an object that has these properties and no others."""
    return {
        "description": description,
        "type": "object",
        "properties": dict(properties),
        "required": list(properties),
        "additionalProperties": False,
    }
