"""The last shard: the files about the whole dataset."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO, cast

from pipeline.paths import file_digest
from pipeline.stage import Outcome, Task
from stages.package import standalone_verifier
from stages.package.card import CardText, card, citation
from stages.package.classes import count_classes, table_bytes
from stages.package.hashing import HashingStream
from stages.package.index import column_kinds, read_rows, write_index
from stages.package.layout import (
    CARD,
    CHECKSUMS,
    CLASSES,
    CROISSANT,
    MANIFEST,
    PREVIEW,
    SCHEMA,
    VERIFIER,
    index_path,
)
from stages.package.manifest import checksums, manifest
from stages.package.sources import SourceTally
from stages.shape.collection.classes import Classes
from stages.shape.collection.discovery import language_of


def compose_dataset(task: Task) -> Outcome:
    """Write card, Croissant, schema, classes, manifest, checksums, verifier and index.

    Params of the shard:

    facts, producer: name and other facts of the dataset, and its producer
    joined: the producers whose samples it joins, if it does
    sections: the whole config
    shards: summaries of the package's shards
    members: name, sentence, dtype and shape of each
    schema: JSON schema of the records
    graphs_share_split: whether samples of one kit with equal graphs are in one split, or for which producers
    origins: the files that the dataset was made from
    card_text: the other fields of `CardText`
    measures: figures for the manifest
    preview: the shard with the preview picture
    software: versions of code and libraries
    """
    from stages.package.croissant import croissant  # imports mlcroissant, which takes seconds

    params = task.shard.params
    shards, facts, members = params["shards"], params["facts"], params["members"]
    rows = read_rows(task.input("package", f"{shard['name']}.jsonl") for shard in shards)
    tallied: dict[tuple[str, str], SourceTally] = {}
    kinds = column_kinds(params["schema"]["properties"])
    with task.output(f"{task.shard.name}.parquet") as stream:
        index = HashingStream(stream)
        write_index(SourceTally.tallied(rows, tallied), kinds, cast(BinaryIO, index))
    indexed: dict[str, Any] = {
        "path": f"../{index_path(task.config)}",
        "bytes": index.written,
        "sha256": index.digest(),
        "columns": kinds,
    }
    sources_by_name = language_of(params["producer"]).decoder(task).sources
    of_shards = ((shard["split"], _read(task, f"{shard['name']}.classes.json")) for shard in shards)
    classes = count_classes(Classes.of(sources_by_name), of_shards, owned="joined" in params)
    class_table = table_bytes(classes)
    class_file = {"path": CLASSES, "count": len(classes), "sha256": hashlib.sha256(class_table).hexdigest()}
    kits = [kit for kit in sources_by_name if kit in {kit for _, kit in tallied}]
    tallies, sources = dict[str, SourceTally](), dict[str, str]()
    for producer, kit in sorted(tallied, key=lambda pair: (kits.index(pair[1]), pair)):
        name = f"{kit} by {producer}" if "joined" in params else kit
        tallies[name], sources[name] = tallied[producer, kit], sources_by_name[kit].sentence
    text = CardText(kits=kits, **params["card_text"], origins=params["origins"])
    files = {
        CARD: card(facts, shards, members, tallies, sources, classes, text).encode(),
        CROISSANT: _text(croissant(facts, shards, members, indexed, class_file, params["origins"], citation(facts))),
        SCHEMA: _text(params["schema"]),
        CLASSES: class_table,
        VERIFIER: Path(standalone_verifier.__file__).read_bytes(),
    }
    digests = {file: hashlib.sha256(content).hexdigest() for file, content in files.items()}
    digests[PREVIEW] = file_digest(task.input("package", f"{params['preview']}.png"))
    document = manifest(
        *(facts, params["sections"], shards, members, digests, indexed, class_file),
        *(params["measures"], params["software"], params["origins"]),
    )
    files[MANIFEST] = _text({**document, "graphs_share_split": params["graphs_share_split"]})
    digests[MANIFEST] = hashlib.sha256(files[MANIFEST]).hexdigest()
    digests.update({shard["path"]: shard["sha256"] for shard in shards})
    files[CHECKSUMS] = checksums(digests).encode()
    for file, content in files.items():
        with task.output(f"{task.shard.name}.{file}") as stream:
            stream.write(content)
    return Outcome(samples=0, summary={"samples": sum(tally.samples for tally in tallies.values())})


def _read(task: Task, file: str) -> Any:
    return json.loads(task.input("package", file).read_bytes())


def _text(document: Mapping[str, Any]) -> bytes:
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False).encode() + b"\n"
