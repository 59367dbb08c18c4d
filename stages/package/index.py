"""The index: one Parquet row per sample, for choosing and reading samples without reading shards."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO

from stages.shape.collection.discovery import members
from stages.shape.collection.members import IndexColumn

RECORD_COLUMNS = {
    "key": IndexColumn("string", ("key",)),
    "split": IndexColumn("string", ("split",)),
    "kit": IndexColumn("string", ("kit",)),
    "graph": IndexColumn("string", ("graph",)),
    "producer": IndexColumn("string", ("producer",)),
    "parts": IndexColumn("int32", ("counts", "parts")),
    "contacts": IndexColumn("int32", ("counts", "contacts")),
    "pieces": IndexColumn("int32", ("counts", "pieces")),
    "cycles": IndexColumn("int32", ("counts", "cycles")),
    "types": IndexColumn("int32", ("counts", "types")),
    "unit": IndexColumn("string", ("unit",)),
    "text": IndexColumn("string", ("text",)),
    "contrast": IndexColumn("string", ("lineage", "contrast", "role")),
    "partner": IndexColumn("string", ("lineage", "contrast", "partner")),
}
"""Columns from a record, besides those that stages declare."""

LOCATION_COLUMNS = {"shard": "string", "offset": "int64", "bytes": "int64"}
"""Location of a sample: `shard` is relative to the dataset's folder; `bytes` at `offset` are its members as a tar."""

ROWS_PER_GROUP = 65_536


def columns(record: Mapping[str, Any]) -> dict[str, IndexColumn]:
    """Return the columns that come from a record, by name. In place of a record, a mapping of its form will do."""
    declared = (added.columns for added in members().values())
    known = RECORD_COLUMNS | {name: column for own in declared for name, column in own.items()}
    return {name: column for name, column in known.items() if _holds(record, column.place)}


def column_kinds(properties: Mapping[str, Any]) -> dict[str, str]:
    """Return the Arrow type of every column of the index, by name. properties: schemas of the fields of its records"""
    return {name: column.kind for name, column in columns(_form(properties)).items()} | LOCATION_COLUMNS


def _form(properties: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of records with this schema, and the fields of those that are objects."""
    return {name: _form(schema.get("properties", {})) for name, schema in properties.items()}


def _holds(record: Mapping[str, Any], place: Sequence[str]) -> bool:
    """Return whether a record has a value at a place."""
    first, *rest = place
    return first in record and (not rest or _holds(record[first], rest))


def index_row(record: Mapping[str, Any], path: str, offset: int, size: int) -> dict[str, Any]:
    """Return the row of a sample with `size` bytes at `offset` of the shard at `path`."""
    row: dict[str, Any] = {}
    for name, column in columns(record).items():
        value: Any = record
        for step in column.place:
            value = value[step]
        row[name] = value
    return row | {"shard": path, "offset": offset, "bytes": size}


def tar_bytes(members: Mapping[str, bytes]) -> int:
    """Return the size of the members of a sample in a tar, with headers, in bytes."""
    return sum(512 + (len(content) + 511) // 512 * 512 for content in members.values())


def read_rows(files: Iterable[Path]) -> Iterator[dict[str, Any]]:
    """Yield the rows of the package's shards in order, one in memory at a time."""
    for file in files:
        with open(file, encoding="utf-8") as lines:
            yield from map(json.loads, lines)


def write_index(rows: Iterable[Mapping[str, Any]], kinds: Mapping[str, str], stream: BinaryIO) -> None:
    """Write rows as Parquet, one row group in memory at a time; equal rows give equal bytes.

    kinds: Arrow type of each column
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    schema = pa.schema([(name, pa.type_for_alias(kind)) for name, kind in kinds.items()])
    rest = iter(rows)
    with pq.ParquetWriter(stream, schema, compression="zstd") as writer:
        while group := list(islice(rest, ROWS_PER_GROUP)):
            columns = {name: pa.array([row[name] for row in group], schema.field(name).type) for name in kinds}
            group.clear()  # before the next is read
            writer.write_table(pa.table(columns), row_group_size=ROWS_PER_GROUP)
