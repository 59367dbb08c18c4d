"""What stands in a card and a Croissant file of the files that a dataset was made from."""

from __future__ import annotations

from stages.package.croissant import croissant
from stages.package.tables import origin_table

ORIGIN = {"kit": "castle", "file": "tower/model.glb", "sha256": "ab" * 32, "key": "exemplars.kits[castle].credit"}
SAID = {"author": "Jane | Doe", "source": "https://example.org", "license": "MIT", "notice": "Copyright\n(c) Jane"}
UNSAID = dict.fromkeys(SAID, "")
FACTS = {
    "name": "toy",
    "version": "1.0.0",
    "title": "Toy",
    "description": "A toy.",
    "license": "MIT",
    "creator": "Jane",
    "published": "2026-01-01",
    "tags": [],
}
INDEX = {"path": "../toy-index/toy.parquet", "bytes": 1, "sha256": "00" * 32, "columns": {"key": "string"}}
CLASSES = {"sha256": "12" * 32}
SHARD = {"path": "data/train/toy.tar", "split": "train", "samples": 1, "bytes": 1, "sha256": "34" * 32}


def test_origin_table_gives_credit_and_names_what_is_missing() -> None:
    *_, said, unsaid = origin_table([{**ORIGIN, **SAID}, {**ORIGIN, **UNSAID}]).splitlines()
    assert said == (
        "| tower/model.glb | castle | Jane \\| Doe | https://example.org | MIT | Copyright (c) Jane | `abababababab…` |"
    )
    assert unsaid == "| tower/model.glb | castle |  |  | not stated |  | `abababababab…` |"


def test_croissant_names_the_origins() -> None:
    said, unsaid = croissant(FACTS, [SHARD], [], INDEX, CLASSES, [{**ORIGIN, **SAID}, {**ORIGIN, **UNSAID}], "cited")[
        "isBasedOn"
    ]
    assert said == {
        "@type": "sc:CreativeWork",
        "name": "tower/model.glb",
        "identifier": f"sha256:{'ab' * 32}",
        "author": {"@type": "sc:Person", "name": "Jane | Doe"},
        "url": "https://example.org",
        "license": "MIT",
        "creditText": "Copyright\n(c) Jane",
    }
    assert unsaid == {key: said[key] for key in ("@type", "name", "identifier")}
    assert "isBasedOn" not in croissant(FACTS, [SHARD], [], INDEX, CLASSES, [], "cited")
