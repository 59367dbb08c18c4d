"""The index: one row a sample, as Parquet, so that samples can be chosen and read without reading shards."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, BinaryIO

__all__ = ["COLUMNS", "read_rows", "write_index"]

COLUMNS = {
    "key": "string",
    "split": "string",
    "kit": "string",
    "graph": "string",
    "producer": "string",
    "shard": "string",
    "offset": "int64",
    "bytes": "int64",
    "parts": "int32",
    "contacts": "int32",
    "cycles": "int32",
    "types": "int32",
    "text": "string",
}
"""Columns and their Arrow types. `shard` is relative to the dataset's folder; the `bytes` bytes at `offset` of that
file are the sample's members as a tar."""


def read_rows(files: Iterable[Path]) -> list[dict[str, Any]]:
    """The rows that the shards of the package kept, in order."""
    return [json.loads(line) for file in files for line in file.read_text().splitlines()]


def write_index(rows: list[dict[str, Any]] | list[Mapping[str, Any]], stream: BinaryIO) -> None:
    """Write the rows as Parquet; equal rows give equal bytes."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    schema = pa.schema([(name, pa.type_for_alias(kind)) for name, kind in COLUMNS.items()])
    table = pa.table({name: pa.array([row[name] for row in rows], schema.field(name).type) for name in COLUMNS})
    pq.write_table(table, stream, compression="zstd", row_group_size=65_536)
