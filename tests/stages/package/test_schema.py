"""`schema.json`: every record keeps it, and what breaks it is named."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pipeline.shards import read_shard
from stages.package.schema import schema_faults, validator_of

Record = dict[str, Any]


@pytest.fixture(scope="module")
def records(toy_folder: Path) -> list[Record]:
    return [json.loads(m["json"]) for path in sorted(toy_folder.rglob("*.tar")) for _, m in read_shard(path)]


def faults(folder: Path, record: object) -> list[str]:
    return list(schema_faults(validator_of((folder / "schema.json").read_text(encoding="utf-8")), record))


def test_every_record_keeps_the_schema_of_its_dataset(toy_folder: Path, records: list[Record]) -> None:
    for record in records:
        assert faults(toy_folder, record) == []


def test_every_field_is_described(toy_folder: Path) -> None:
    schema = json.loads((toy_folder / "schema.json").read_text(encoding="utf-8"))
    assert schema["$schema"].endswith("2020-12/schema")
    assert [name for name, field in schema["properties"].items() if not field.get("description")] == []


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda record: record.pop("kit"), "'kit' is a required property"),
        (lambda record: record.update(extra=1), "'extra' was unexpected"),
        (lambda record: record["physics"].update(rooted=1), "physics.rooted: 1 is not of type 'boolean'"),
        (lambda record: record["lineage"].update(parents=[]), "lineage.parents: [] should be non-empty"),
        (lambda record: record["lineage"].update(other="x"), "lineage: Additional properties are not allowed"),
        (lambda record: record["parts"][0]["pose"].pop(), "parts[0].pose: "),
        (lambda record: record["parts"][0].update(label=""), "parts[0].label: '' should be non-empty"),
        (lambda record: record.update(text=None), "text: None is not of type 'string'"),
        (lambda record: record.update(split="dev"), "split: 'dev' is not one of"),
        (lambda record: record.update(contact_tolerance=0.0), "contact_tolerance: "),
    ],
)
def test_violations_are_named(
    toy_folder: Path, records: list[Record], change: Callable[[Record], object], said: str
) -> None:
    record = json.loads(json.dumps(records[0]))
    change(record)
    (fault,) = faults(toy_folder, record)
    assert fault.startswith("its json is not as schema.json says: ")
    assert said in fault


@pytest.mark.parametrize("record", [[], None, "x", 3])
def test_invalid_record_is_named(toy_folder: Path, record: object) -> None:
    assert any("the whole" in fault for fault in faults(toy_folder, record))
