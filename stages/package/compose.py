"""The shard that is made last: the files that speak of the whole dataset."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any, BinaryIO, cast

from pipeline.paths import file_digest
from pipeline.stage import Outcome, Task
from stages.package.card import Story, card, citation
from stages.package.classes import count_classes, table_bytes
from stages.package.croissant import croissant
from stages.package.hashing import HashingStream
from stages.package.index import column_kinds, read_rows, write_index
from stages.package.layout import CARD, CHECKSUMS, CLASSES, CROISSANT, MANIFEST, PREVIEW, SCHEMA, index_path
from stages.package.manifest import checksums, manifest
from stages.package.sources import SourceTally
from stages.shape.collection.classes import Classes
from stages.shape.collection.discovery import language_of


def compose_dataset(task: Task) -> Outcome:
    """Write card, Croissant, schema, classes, manifest, checksums and index.

    The shard's params hold `facts`; `producer`; `sections` (the whole config); `shards` (summaries of the package's
    shards); `members` (what is to say of each); `schema` (of the records); `apart` (whether graphs keep the splits
    apart); `origins` (what the dataset was made from); `story` (the other fields of the card's `Story`); `measures`
    (figures for the manifest); `preview` (the shard with the picture) and `made_with` (versions of code and libraries).
    """
    params = task.shard.params
    shards, facts, members = params["shards"], params["facts"], params["members"]
    rows = read_rows(task.input("package", f"{shard['name']}.jsonl") for shard in shards)
    tallies: dict[str, SourceTally] = {}
    with task.output(f"{task.shard.name}.parquet") as stream:
        index = HashingStream(stream)
        write_index(SourceTally.tallied(rows, tallies), cast(BinaryIO, index))
    indexed: dict[str, Any] = {
        "path": f"../{index_path(task.config)}",
        "bytes": index.written,
        "sha256": index.digest(),
        "columns": column_kinds(),
    }
    known = language_of(params["producer"]).decoder(task).sources
    of_shards = ((shard["split"], _read(task, f"{shard['name']}.classes.json")) for shard in shards)
    classes = count_classes(Classes.of(known), of_shards)
    listed = table_bytes(classes)
    counted = {"path": CLASSES, "count": len(classes), "sha256": hashlib.sha256(listed).hexdigest()}
    sources = {name: each.sentence for name, each in known.items() if name in tallies}
    story = Story(**params["story"], origins=params["origins"])
    files = {
        CARD: card(facts, shards, members, tallies, sources, classes, story).encode(),
        CROISSANT: _text(croissant(facts, shards, members, indexed, counted, params["origins"], citation(facts))),
        SCHEMA: _text(params["schema"]),
        CLASSES: listed,
    }
    digests = {file: hashlib.sha256(content).hexdigest() for file, content in files.items()}
    digests[PREVIEW] = file_digest(task.input("package", f"{params['preview']}.png"))
    described = manifest(
        *(facts, params["sections"], shards, members, digests, indexed, counted),
        *(params["measures"], params["made_with"], params["origins"]),
    )
    files[MANIFEST] = _text({**described, "apart": params["apart"]})
    digests[MANIFEST] = hashlib.sha256(files[MANIFEST]).hexdigest()
    digests.update({shard["path"]: shard["sha256"] for shard in shards})
    files[CHECKSUMS] = checksums(digests).encode()
    for file, content in files.items():
        with task.output(f"{task.shard.name}.{file}") as stream:
            stream.write(content)
    return Outcome(samples=0, summary={"samples": sum(each.samples for each in tallies.values())})


def _read(task: Task, file: str) -> Any:
    return json.loads(task.input("package", file).read_bytes())


def _text(document: Mapping[str, Any]) -> bytes:
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False).encode() + b"\n"
