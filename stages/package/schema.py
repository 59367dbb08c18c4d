"""`schema.json`: what the JSON member of every sample of a dataset holds (JSON Schema 2020-12).

Put together of package's own fields, those that stages declare in `members.py`, and what the producer says in
`producer.py` of its lineage. No field is optional, none may be there that is not declared, and nothing may be empty.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from pipeline.config import Config
from stages.shape.collection.discovery import language_of, members, producers

if TYPE_CHECKING:
    from jsonschema.protocols import Validator

SCHEMA_DIALECT = "https://json-schema.org/draft/2020-12/schema"
MAX_FAULTS_LISTED = 5


def record_schema(config: Config, producer: str, stages: Iterable[str]) -> dict[str, Any]:
    """The schema of the records of a dataset that `producer` makes and to whose samples `stages` add."""
    declared = members()
    added = {name: dict(field.schema) for stage in stages for name, field in declared[stage].fields(config).items()}
    own = {
        **_own_fields(),
        "producer": {"const": producer, "description": "the stage that made the sample"},
        "language": {"const": language_of(producer).name, "description": "what the sample's text or assembly is"},
        "lineage": _lineage({name: field.schema for name, field in producers()[producer].lineage(config).items()}),
    }
    return {
        "$schema": SCHEMA_DIALECT,
        "title": f"{config.name}: the record of a sample",
        "description": "What <key>.json holds. Every sample has every field; nothing is null, and nothing is empty.",
        **_object({**own, **added}),
    }


@lru_cache(maxsize=4)
def validator_of(schema: str) -> Validator:
    """The validator of a schema given as JSON. Raises jsonschema.SchemaError for what is none."""
    from jsonschema import Draft202012Validator

    loaded = json.loads(schema)
    Draft202012Validator.check_schema(loaded)
    return Draft202012Validator(loaded)


def schema_faults(validator: Validator, record: Any) -> Iterator[str]:
    """What of a record is not as the schema says, a sentence each, a few at most."""
    for _, error in zip(range(MAX_FAULTS_LISTED), validator.iter_errors(record), strict=False):
        place = error.json_path.removeprefix("$").removeprefix(".")
        yield f"its json is not as schema.json says: {place or 'the whole'}: {error.message[:200]}"


def _own_fields() -> dict[str, dict[str, Any]]:
    """The fields that every record has, whatever made its sample."""
    return {
        "key": {
            "type": "string",
            "pattern": "^[^.]+$",
            "description": "unique in the dataset; the files of the sample are called <key>.<member>",
        },
        "split": {"enum": ["train", "val", "test"], "description": "the split that the sample is in"},
        "producer": {},
        "language": {},
        "kit": _text("the kit, the program or the category of programs that the sample comes from"),
        "graph": {
            "type": "string",
            "pattern": "^[0-9a-f]+$",
            "description": "digest of the structure: equal for samples of one kit with equal shape graphs, or of one "
            "program that are alike up to continuous parameters",
        },
        "lineage": {},
        "parts": {
            "type": "array",
            "minItems": 1,
            "description": "the parts; where others name a part, they give its place in this list",
            "items": _object(
                {
                    "name": _text("the part's own name, that of its node in the mesh"),
                    "label": _text("what the part is; parts of one kit or program with one label are of one class"),
                    "class": _whole("id of the label, unique in the dataset"),
                    "instance": _whole("the part's place in this list"),
                    "pose": {
                        **_numbers(4, 4),
                        "description": "moves the part's mesh from its own coordinates into those of the shape; a "
                        "4x4 matrix, row by row, for column vectors; rigid, but of a part that was stretched "
                        "(lineage.deformed)",
                    },
                }
            ),
        },
        "counts": {
            "description": "how much there is of what",
            **_object(
                {
                    "parts": _whole("parts"),
                    "contacts": _whole("pairs of parts in contact"),
                    "pieces": _whole("pieces that the contacts make; parts of different pieces do not touch"),
                    "cycles": _whole("independent cycles of the contact graph"),
                    "types": _whole("different labels"),
                }
            ),
        },
        "bounds": {**_numbers(2, 3), "description": "lowest and highest corner of the box around the shape"},
        "text": _text("the text that the sample is made from, or the canonical string of its shape graph"),
    }


def _lineage(declared: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    common = {
        "method": _text("how the sample was made, in a word of its producer"),
        "parents": {
            "type": "array",
            "minItems": 1,
            "items": _text(""),
            "description": "what the sample was made from: keys of samples, or names of exemplars, programs or files",
        },
    }
    return {"description": "where the sample comes from", **_object({**common, **declared})}


def _object(properties: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    return {
        "type": "object",
        "properties": dict(properties),
        "required": list(properties),
        "additionalProperties": False,
    }


def _text(description: str) -> dict[str, Any]:
    described = {"description": description} if description else {}
    return {"type": "string", "minLength": 1, **described}


def _whole(description: str) -> dict[str, Any]:
    return {"type": "integer", "minimum": 0, "description": description}


def _numbers(*lengths: int) -> dict[str, Any]:
    """An array of arrays of these lengths of numbers."""
    schema: dict[str, Any] = {"type": "number"}
    for length in reversed(lengths):
        schema = {"type": "array", "items": schema, "minItems": length, "maxItems": length}
    return schema
