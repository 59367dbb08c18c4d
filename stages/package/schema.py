"""`schema.json`: the fields of the JSON member of every sample (JSON Schema 2020-12).

It joins the package's own fields, those that stages declare in `members.py`, and the lineage that the producer declares
in `producer.py`. Every field is required, no other is allowed, and none may be empty.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from pipeline.config import Config
from stages.shape.collection.discovery import language_of, members, producers
from stages.shape.collection.members import TEXT

if TYPE_CHECKING:
    from jsonschema.protocols import Validator

SCHEMA_DIALECT = "https://json-schema.org/draft/2020-12/schema"
MAX_FAULTS_LISTED = 5


def record_schema(config: Config, producer: str, joined: Sequence[str], stages: Collection[str]) -> dict[str, Any]:
    """Return the schema of the records of a dataset, by its producer and the stages that add fields.

    joined: the producers whose samples it joins, if it does
    """
    declared, language = members(), language_of(producer)
    names = [language_of(name).name for name in joined] or [language.name]
    added = {name: dict(field.schema) for stage in stages for name, field in declared[stage].fields(config).items()}
    own = {
        **_own_fields(),
        "producer": {**_one_of(joined or [producer]), "description": "the stage that made the sample"},
        "language": {**_one_of(names), "description": "format of the sample's text or assembly"},
        "lineage": _lineage({name: field.schema for name, field in producers()[producer].lineage(config).items()}),
    }
    if joined:
        part = own["parts"]["items"]["properties"]
        part["own_class"] = _whole(
            "number of the label among those of its kit: its class in a dataset of this kit alone"
        )
        own["parts"]["items"] = _object(part)
    if language.graphs and not any(item.name == TEXT for stage in stages for item in declared[stage].of(config)):
        del own["text"]
    return {
        "$schema": SCHEMA_DIALECT,
        "title": f"{config.name}: the record of a sample",
        "description": "Content of <key>.json. Every sample has every field; none is null or empty.",
        **_object({**own, **added}),
    }


@lru_cache(maxsize=4)
def validator_of(schema: str) -> Validator:
    """Return the validator of a schema, given as JSON. Raises jsonschema.SchemaError."""
    from jsonschema import Draft202012Validator

    loaded = json.loads(schema)
    Draft202012Validator.check_schema(loaded)
    return Draft202012Validator(loaded)


def schema_faults(validator: Validator, record: Any) -> Iterator[str]:
    """Yield a sentence for each violation of the schema, at most MAX_FAULTS_LISTED."""
    for _, error in zip(range(MAX_FAULTS_LISTED), validator.iter_errors(record), strict=False):
        where = error.json_path.removeprefix("$").removeprefix(".")
        yield f"its json is not as schema.json says: {where or 'the whole'}: {error.message[:200]}"


def _own_fields() -> dict[str, dict[str, Any]]:
    """Return the fields of every record."""
    return {
        "key": {
            "type": "string",
            "pattern": "^[^.]+$",
            "description": "unique in the dataset; the files of the sample are named <key>.<member>",
        },
        "split": {"enum": ["train", "val", "test"], "description": "split of the sample"},
        "producer": {},
        "language": {},
        "kit": _text("source of the sample: a kit, a program or a category of programs"),
        "graph": {
            "type": "string",
            "pattern": "^[0-9a-f]+$",
            "description": "digest of the structure: equal for samples of one kit with equal shape graphs, or of one "
            "program that are equal up to continuous parameters",
        },
        "lineage": {},
        "parts": {
            "type": "array",
            "minItems": 1,
            "description": "the parts; other fields refer to a part by its index in this list",
            "items": _object(
                {
                    "name": _text("name of the part, and of its node in the mesh"),
                    "label": _text("label of the part; parts of one kit or program with one label have one class"),
                    "class": _whole("id of the label, unique in the dataset"),
                    "instance": _whole("index of the part in this list"),
                    "pose": {
                        **_numbers(4, 4),
                        "description": "maps the part's own coordinates to those of the shape; a "
                        "4x4 matrix, row by row, for column vectors; rigid except for stretched parts "
                        "(lineage.deformed)",
                    },
                }
            ),
        },
        "counts": {
            "description": "numbers of parts, contacts and more",
            **_object(
                {
                    "parts": _whole("number of parts"),
                    "contacts": _whole("pairs of parts in contact"),
                    "pieces": _whole("connected components of the contact graph"),
                    "cycles": _whole("independent cycles of the contact graph"),
                    "types": _whole("different labels"),
                }
            ),
        },
        "bounds": {**_numbers(2, 3), "description": "lowest and highest corner of the bounding box"},
        "unit": {
            "enum": ["metre", "unknown"],
            "description": "unit of all coordinates: metre, or unknown where the sources state none",
        },
        "text": _text("the text that the sample is made from, or the canonical string of its shape graph"),
    }


def _lineage(declared: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    common = {
        "method": _text("method of the producer that made the sample"),
        "parents": {
            "type": "array",
            "minItems": 1,
            "items": _text(""),
            "description": "sources of the sample: keys of samples, or names of exemplars, programs or files",
        },
    }
    return {"description": "provenance of the sample", **_object({**common, **declared})}


def _object(properties: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    return {
        "type": "object",
        "properties": dict(properties),
        "required": list(properties),
        "additionalProperties": False,
    }


def _one_of(values: Sequence[str]) -> dict[str, Any]:
    """Return the schema of a text that is one of some values."""
    return {"const": values[0]} if len(values) == 1 else {"enum": list(dict.fromkeys(values))}


def _text(description: str) -> dict[str, Any]:
    return {"type": "string", "minLength": 1, **({"description": description} if description else {})}


def _whole(description: str) -> dict[str, Any]:
    return {"type": "integer", "minimum": 0, "description": description}


def _numbers(*lengths: int) -> dict[str, Any]:
    """Return the schema of nested arrays of numbers, with the length of each level."""
    schema: dict[str, Any] = {"type": "number"}
    for length in reversed(lengths):
        schema = {"type": "array", "items": schema, "minItems": length, "maxItems": length}
    return schema
