"""The shard that is made last: the files that speak of the whole dataset."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Iterable, Mapping
from typing import Any

from pipeline.places import file_digest
from pipeline.stage import Outcome, Task
from stages.package.card import card, citation, member_text
from stages.package.croissant import croissant
from stages.package.index import read_rows, write_index
from stages.package.layout import CARD, CHECKSUMS, CROISSANT, MANIFEST, PREVIEW, index_path
from stages.package.manifest import checksums, manifest
from stages.shape.kit import Kit
from stages.shape.kit_input import input_kits

__all__ = ["compose_dataset"]


def compose_dataset(task: Task) -> Outcome:
    """Write card, Croissant, manifest, checksums and index.

    The shard's params hold `facts`, `producer` (the stage that made the samples), `sections` (the whole config),
    `shards` (summaries of the package's shards), `search`, `rejects` and `measures` (what the card says of the search
    and its finds), `preview` (the shard with the picture) and `package` (the version of this stage).
    """
    params = task.shard.params
    producer = params["producer"]
    shards, facts = params["shards"], params["facts"]
    rows = read_rows(task.input("package", f"{shard['name']}.jsonl") for shard in shards)
    index = io.BytesIO()
    write_index(rows, index)
    indexed = {
        "path": f"../{index_path(task.config)}",
        "bytes": len(index.getvalue()),
        "sha256": hashlib.sha256(index.getvalue()).hexdigest(),
    }
    kits = input_kits(task)
    sources = {name: _described(kits.get(name)) for name in sorted({row["kit"] for row in rows})}
    members = {member: member_text(member) for member in shards[0]["members"]}
    files = {
        CARD: card(
            *(facts, shards, rows, producer, sources, params["search"], params["rejects"], params["measures"]),
            _recipes(producer, sources),
        ).encode(),
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


def _recipes(producer: str, names: Iterable[str]) -> list[str]:
    """What there is to say of each program that the samples were made with."""
    if producer != "programs":
        return []
    from stages.programs.program import find_program
    from stages.programs.recipe import recipe_markdown

    return [recipe_markdown(find_program(name)).rstrip() for name in names]


def _described(kit: Kit | None) -> str:
    """What stands behind the name of a kit on the card; of a program nothing does."""
    if kit is None:
        return ""
    count = len(kit.exemplars)
    return f"{count} exemplar{'' if count == 1 else 's'}, {len(kit.types)} part types"


def _text(document: Mapping[str, Any]) -> bytes:
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False).encode() + b"\n"
