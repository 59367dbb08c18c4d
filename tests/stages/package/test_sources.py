"""What a card tells of a kit is counted row by row, and the index is written without holding all rows."""

from __future__ import annotations

import io
import weakref
from collections.abc import Iterator
from typing import Any

import pyarrow.parquet as pq

from stages.package.index import ROWS_PER_GROUP, column_kinds, index_row, write_index
from stages.package.sources import SourceTally

FIELDS: dict[str, Any] = {
    **{name: {} for name in ("key", "split", "kit", "graph", "producer", "text")},
    "counts": {"properties": {name: {} for name in ("parts", "contacts", "cycles")}},
    "physics": {"properties": {name: {} for name in ("rooted", "stable")}},
}
KINDS = column_kinds(FIELDS)


class Row(dict[str, Any]):
    """A row that can be watched."""


def row(number: int) -> Row:
    values = {"string": "x", "bool": True, "float64": 0.5}
    text = {"key": f"k{number}", "kit": "toy", "graph": f"g{number // 2}", "parts": number, "stable": number == 0}
    return Row({name: values.get(kind, 1) for name, kind in KINDS.items()} | text)


def test_tally_agrees_with_lists() -> None:
    tally = SourceTally()
    for number in (4, 0, 1, 3):
        tally.add(row(number))
    assert (tally.samples, tally.rooted, tally.stable, tally.structures) == (4, 4, 1, 3)
    assert tally.span("parts") == "0 / 2 / 4"
    tally.add(row(3))
    assert tally.span("parts") == "0 / 3 / 4"
    assert (tally.samples, tally.structures) == (5, 3)


def test_the_index_holds_a_group_of_rows_at_a_time() -> None:
    alive: weakref.WeakValueDictionary[int, Row] = weakref.WeakValueDictionary()
    most = 0

    def rows() -> Iterator[Row]:
        nonlocal most
        for number in range(2 * ROWS_PER_GROUP + 2):
            alive[number] = fresh = row(number)
            most = max(most, len(alive) if number % 1000 == 0 else 0)
            yield fresh

    written, tallies = io.BytesIO(), dict[tuple[str, str], SourceTally]()
    write_index(SourceTally.tallied(rows(), tallies), KINDS, written)
    assert most <= ROWS_PER_GROUP + 2
    read = pq.ParquetFile(written)
    assert [read.metadata.row_group(group).num_rows for group in range(3)] == [ROWS_PER_GROUP, ROWS_PER_GROUP, 2]
    assert read.read(["key"])["key"].to_pylist() == [f"k{number}" for number in range(2 * ROWS_PER_GROUP + 2)]
    ((_, tally),) = tallies.items()
    assert tally.samples == 2 * ROWS_PER_GROUP + 2


def test_a_column_is_in_the_index_where_all_records_have_its_value() -> None:
    assert {"rooted", "stable", "cycles"} <= set(KINDS)
    assert not {"falls", "margin", "pieces"} & set(KINDS)
    record = {"key": "k", "counts": {"parts": 3}, "physics": {"falls": True, "fall_degrees": 2.5}}
    found = {"key": "k", "parts": 3, "falls": True, "fall_degrees": 2.5}
    assert index_row(record, "data/a.tar", 512, 1024) == found | {"shard": "data/a.tar", "offset": 512, "bytes": 1024}
