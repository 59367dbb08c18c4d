"""The shard that is made last: the files that speak of the whole dataset."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Mapping
from typing import Any

from pipeline.places import file_digest
from pipeline.stage import Outcome, Task
from stages.package.card import card, citation, member_text
from stages.package.croissant import croissant
from stages.package.index import read_rows, write_index
from stages.package.layout import CARD, CHECKSUMS, CROISSANT, MANIFEST, PREVIEW, index_path
from stages.package.manifest import checksums, manifest
from stages.shape.collection import collection_kits
from stages.shape.kit import Kit

__all__ = ["compose_dataset"]


def compose_dataset(task: Task) -> Outcome:
    """Write card, Croissant, manifest, checksums and index.

    The shard's params hold `facts`, `sections` (the whole config), `shards` (summaries of the package's shards),
    `search`, `rejects` and `measures` (what the card says of the search and its finds), `preview` (the shard with the
    picture) and `package` (the version of this stage).
    """
    params = task.shard.params
    shards, facts = params["shards"], params["facts"]
    rows = read_rows(task.input("package", f"{shard['name']}.jsonl") for shard in shards)
    index = io.BytesIO()
    write_index(rows, index)
    indexed = {
        "path": f"../{index_path(task.config)}",
        "bytes": len(index.getvalue()),
        "sha256": hashlib.sha256(index.getvalue()).hexdigest(),
    }
    kits = [_described(kit) for kit in collection_kits(task).values()]
    members = {member: member_text(member) for member in shards[0]["members"]}
    files = {
        CARD: card(facts, shards, rows, kits, params["search"], params["rejects"], params["measures"]).encode(),
        CROISSANT: _text(croissant(facts, shards, members, citation(facts))),
        MANIFEST: _text(manifest(facts, params["sections"], shards, indexed, params["measures"], params["package"])),
    }
    digests = {file: hashlib.sha256(content).hexdigest() for file, content in files.items()}
    digests[PREVIEW] = file_digest(task.input("package", f"{params['preview']}.png"))
    digests.update({shard["path"]: shard["sha256"] for shard in shards})
    files[CHECKSUMS] = checksums(digests).encode()
    for file, content in {**files, "parquet": index.getvalue()}.items():
        with task.output(f"{task.shard.name}.{file}") as stream:
            stream.write(content)
    return Outcome(samples=0, summary={"samples": len(rows)})


def _described(kit: Kit) -> dict[str, Any]:
    return {"name": kit.name, "types": len(kit.types), "exemplars": len(kit.exemplars)}


def _text(document: Mapping[str, Any]) -> bytes:
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False).encode() + b"\n"
